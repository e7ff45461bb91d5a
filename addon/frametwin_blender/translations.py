"""The panels in German and Japanese, through Blender's own catalogue: what has no entry here stays English.

Words stand in a context of their own, in which Blender's catalogue has none: there, *Fast* is not fast in German.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy

CONTEXT = "FrameTwin"
LANGUAGES = ("de_DE", "ja_JP")

WORDS: dict[str, tuple[str, str]] = {
    # files
    "Format": ("Format", "形式"),
    "Unit": ("Einheit", "単位"),
    "As the File Says": ("Wie die Datei sagt", "ファイルのとおり"),
    "Millimetres": ("Millimeter", "ミリメートル"),
    "Centimetres": ("Zentimeter", "センチメートル"),
    "Metres": ("Meter", "メートル"),
    "Inches": ("Zoll", "インチ"),
    "Frame (.json)": ("Fachwerk (.json)", "フレーム (.json)"),
    "Lines (.obj)": ("Linien (.obj)", "線 (.obj)"),
    "Table (.csv)": ("Tabelle (.csv)", "表 (.csv)"),
    "In millimetres.": ("In Millimetern.", "ミリメートル単位。"),
    # presets
    "As in the Paper": ("Wie im Artikel", "論文のとおり"),
    "Broken Struts": ("Gebrochene Stäbe", "折れた部材"),
    "Dome of 16": ("Kuppel aus 16", "16台のドーム"),
    "Eight Webcams Full HD": ("Acht Webcams Full HD", "ウェブカメラ8台 Full HD"),
    "Fresh Print": ("Frischer Druck", "造形直後"),
    "Half Printed": ("Halb gedruckt", "半分造形済み"),
    "Photographs with Plate": ("Fotografien mit Platte", "プレート付き写真"),
    "Quick Try": ("Schneller Versuch", "簡単な試行"),
    "Rendered Pictures": ("Gerenderte Bilder", "レンダー画像"),
    "Wrong Calibration": ("Falsche Kalibrierung", "誤った校正"),
    # photographs, and the fit of them
    "Photographs": ("Fotografien", "写真撮影"),
    "Import Rig": ("Kameras importieren", "カメラ配置をインポート"),
    "Capture from Pictures": ("Aufnahme aus Bildern", "画像から撮影データ"),
    "Show Masks": ("Masken zeigen", "マスクを表示"),
    "Plan at": ("Plan bei", "設計の位置"),
    "Turn": ("Drehung", "回転"),
    "Before": ("Vorher", "造形前"),
    "Moment": ("Zeitpunkt", "時点"),
    "As in the plan": ("Wie im Plan", "設計のとおり"),
    "Up to batch": ("Bis Abschnitt", "バッチまで"),
    "Up to height": ("Bis Höhe", "高さまで"),
    "Masks and Cameras": ("Masken und Kameras", "マスクとカメラ"),
    "Mask": ("Maske", "マスク"),
    "In Any Light": ("In jedem Licht", "どの照明でも"),
    "Paper's Rule": ("Regel des Artikels", "論文の規則"),
    "Leave Out": ("Auslassen", "除外"),
    "May Err": ("Dürfen irren", "誤差あり"),
    "Exact": ("Exakt", "正確"),
    "Anchor": ("Fester Halt", "基準"),
    "More Probable": ("Wahrscheinlicheres", "確からしい方"),
    "Feet": ("Füße", "脚"),
    "Plate": ("Platte", "プレート"),
    "For pictures of your own: import the rig of calibrated cameras.": (
        "Für eigene Bilder: die kalibrierten Kameras importieren.",
        "手持ちの画像には、校正済みカメラ配置をインポートします。",
    ),
    "Orange: print. Grey: unknown.": ("Orange: Druck. Grau: unbekannt.", "橙: 造形物。灰: 不明。"),
    # narrow panels
    "Hide Pictures": ("Bilder ausblenden", "画像を隠す"),
    "Make Capture": ("Aufnahme anlegen", "撮影データ作成"),
    # panels
    "Plan": ("Plan", "設計"),
    "Deform": ("Verformen", "変形"),
    "Cameras": ("Kameras", "カメラ"),
    "Render": ("Rendern", "レンダー"),
    "Fit": ("Anpassen", "当てはめ"),
    "Twin": ("Zwilling", "ツイン"),
    "Struts": ("Stäbe", "部材"),
    "Adapt": ("Nachführen", "適応"),
    "Print": ("Druck", "造形"),
    # buttons
    "Add": ("Hinzufügen", "追加"),
    "Add Frame": ("Fachwerk hinzufügen", "フレームを追加"),
    "By Hand": ("Von Hand", "手動"),
    "Cancel": ("Abbrechen", "キャンセル"),
    "Check Again": ("Erneut prüfen", "再チェック"),
    "Dashes": ("Striche", "破線"),
    "Difference": ("Unterschied", "差分"),
    "Documentation": ("Dokumentation", "ドキュメント"),
    "Exaggeration": ("Überhöhung", "誇張"),
    "Export Adapted": ("Nachgeführte exportieren", "適応結果をエクスポート"),
    "Export Twin": ("Zwilling exportieren", "ツインをエクスポート"),
    "Fit and Adapt": ("Anpassen und nachführen", "当てはめて適応"),
    "Import": ("Importieren", "インポート"),
    "Import Run": ("Lauf importieren", "結果をインポート"),
    "Inspect beside Picture": ("Neben dem Bild prüfen", "画像と並べて検査"),
    "List Struts": ("Stäbe auflisten", "部材を一覧"),
    "Look Through": ("Hindurchsehen", "カメラから見る"),
    "Make Rig": ("Kameras aufstellen", "カメラを配置"),
    "New Job": ("Neuer Auftrag", "新規ジョブ"),
    "No Problems": ("Keine Mängel", "問題なし"),
    "Open Capture": ("Aufnahme öffnen", "撮影データを開く"),
    "Open Preferences": ("Einstellungen öffnen", "設定を開く"),
    "Outline": ("Umriss", "輪郭"),
    "Pick in View": ("In der Ansicht wählen", "ビューで選択"),
    "Picture": ("Bild", "画像"),
    "Planned": ("Geplant", "設計"),
    "Adapted": ("Nachgeführt", "適応後"),
    "Render Capture": ("Aufnahme rendern", "撮影をレンダー"),
    "Replace Rig": ("Kameras ersetzen", "カメラを置き換え"),
    "Report a Bug": ("Fehler melden", "バグを報告"),
    "Select": ("Auswählen", "選択"),
    "Show Job": ("Auftrag zeigen", "ジョブを表示"),
    "Side by Side": ("Nebeneinander", "並べて表示"),
    "Simulate Print": ("Druck simulieren", "造形をシミュレート"),
    "Test": ("Testen", "テスト"),
    "Use Millimetres": ("Millimeter verwenden", "ミリメートルを使用"),
    "Use Selected": ("Auswahl verwenden", "選択物を使用"),
    "Whole Twin": ("Ganzer Zwilling", "ツイン全体"),
    "Worst": ("Schlechteste", "最悪"),
    # settings
    "Automatic Range": ("Automatischer Bereich", "自動範囲"),
    "Batch": ("Abschnitt", "バッチ"),
    "Batch Size": ("Je Abschnitt", "バッチの大きさ"),
    "Capture": ("Aufnahme", "撮影データ"),
    "Colour by": ("Färben nach", "色分け"),
    "Completeness": ("Vollständigkeit", "完全性"),
    "Confidence": ("Sicherheit", "信頼度"),
    "Coupon": ("Probestäbe", "試験片"),
    "Displacement": ("Verschiebung", "変位"),
    "Height mm": ("Höhe mm", "高さ mm"),
    "High Angle": ("Oberer Winkel", "上の角度"),
    "Job": ("Auftrag", "ジョブ"),
    "Kind": ("Art", "種類"),
    "Low Angle": ("Unterer Winkel", "下の角度"),
    "Missing": ("Fehlend", "欠損"),
    "Part Missing": ("Fehlender Teil", "欠損の割合"),
    "Peak 7 %": ("Höchstens 7 %", "最大 7 %"),
    "Peak mm": ("Höchstens mm", "最大 mm"),
    "Pictures": ("Bilder", "画像"),
    "Printed": ("Gedruckt", "造形済み"),
    "Pull": ("Zug", "引張り"),
    "Rig": ("Kameraaufbau", "カメラ配置"),
    "Share": ("Anteil", "割合"),
    "Simulate": ("Simulieren", "シミュレート"),
    "Start at This Twin": ("Hier beginnen", "このツインから開始"),
    "View Angle": ("Bildwinkel", "画角"),
    "Width": ("Breite", "幅"),
    "Height": ("Höhe", "高さ"),
    "Distance": ("Abstand", "距離"),
    "Folder": ("Ordner", "フォルダー"),
    "Frame": ("Fachwerk", "フレーム"),
    "High": ("Oben", "上限"),
    "In Front": ("Davor", "最前面"),
    "Legend": ("Legende", "凡例"),
    "Low": ("Unten", "下限"),
    "Opacity": ("Deckkraft", "不透明度"),
    "Overlay": ("Überlagerung", "オーバーレイ"),
    "Preset": ("Verfahren", "プリセット"),
    "Samples": ("Abtastungen", "サンプル"),
    "Seed": ("Startwert", "シード"),
    "Sort by": ("Ordnen nach", "並べ替え"),
    "Show": ("Zeigen", "表示"),
    "Speed": ("Tempo", "速度"),
    # choices
    "All": ("Alles", "すべて"),
    "All Struts": ("Alle Stäbe", "すべての部材"),
    "As designed": ("Wie entworfen", "設計のまま"),
    "Colour": ("Farbe", "色"),
    "Compensated": ("Vorgehalten", "補償"),
    "Dome": ("Kuppel", "ドーム"),
    "Error": ("Fehler", "誤差"),
    "Fast": ("Schnell", "高速"),
    "Gravity sag": ("Durchhang", "自重によるたわみ"),
    "Largest displacement": ("Größte Verschiebung", "最大変位"),
    "Largest error": ("Größter Fehler", "最大誤差"),
    "Masks": ("Masken", "マスク"),
    "Number": ("Nummer", "番号"),
    "Photos": ("Fotos", "写真"),
    "Push at the top": ("Druck auf die Spitze", "上端の押し"),
    "Ring": ("Ring", "リング"),
    "Shift and turn": ("Verschoben und gedreht", "移動と回転"),
    "Smooth warp": ("Sanft verzogen", "滑らかなゆがみ"),
    "Standard deviation": ("Standardabweichung", "標準偏差"),
    "Torn": ("Abgerissen", "剥離"),
    "Torn ends": ("Abgerissene Enden", "剥離した端"),
    "Uncertain": ("Unsicher", "不確か"),
    "With and without": ("Mit und ohne", "適応あり・なし"),
    # comparison
    "Choose another twin under Compare.": (
        "Unter Vergleichen einen anderen Zwilling wählen.",
        "「比較」で別のツインを選択してください。",
    ),
    "Compare": ("Vergleichen", "比較"),
    "Compare Batches": ("Abschnitte vergleichen", "バッチを比較"),
    "Distance from other": ("Abstand vom anderen", "比較対象との距離"),
    "Distance from {}": ("Abstand von {}", "{} との距離"),
    "From": ("Von", "元"),
    "Largest": ("Größter", "最大"),
    "Mean": ("Mittel", "平均"),
    "No strut is in both.": ("Kein Stab ist in beiden.", "共通の部材がありません。"),
    "Strut {}": ("Stab {}", "部材 {}"),
    "To": ("Nach", "先"),
    "With": ("Mit", "対象"),
    # statistics of the twin, and heads of the list
    "5th percentile": ("5. Perzentil", "5 パーセンタイル"),
    "95th percentile": ("95. Perzentil", "95 パーセンタイル"),
    "Highest": ("Höchster", "最高"),
    "Lowest": ("Niedrigster", "最低"),
    "Radius Guessed": ("Radius geschätzt", "半径は推定"),
    "Strut": ("Stab", "部材"),
    "Suitable Colours": ("Passende Farben", "適した色"),
    "Supports": ("Stützen", "サポート"),
    "Sure": ("Sicher", "確か"),
    "Up to Batch": ("Bis Abschnitt", "表示するバッチまで"),
    "Whole": ("Ganz", "完全"),
    # legend
    "Deviation along": ("Abweichung längs", "長手方向の偏差"),
    "Height above plan": ("Höhe über dem Plan", "設計からの高さ"),
    "Histogram": ("Histogramm", "ヒストグラム"),
    "Radius": ("Radius", "半径"),
    "lost": ("verloren", "脱落"),
    "missing": ("fehlend", "欠損"),
    "no value": ("kein Wert", "値なし"),
    "plan": ("Plan", "設計"),
    "printed": ("gedruckt", "造形済み"),
    "still to print": ("noch zu drucken", "未造形"),
    "still to print, adapted": ("noch zu drucken, nachgeführt", "未造形、適応済み"),
    "would have missed": ("hätte verfehlt", "届かなかったはず"),
    "{} struts": ("{} Stäbe", "部材 {} 本"),
    "Solid shading hides the colours: choose Color > Attribute": (
        "Solide Schattierung verdeckt die Farben: Farbe > Attribut wählen",
        "ソリッド表示では色が見えません: カラー > 属性 を選択",
    ),
    "View transform {} shifts the colours: choose Standard": (
        "Ansichtstransformation {} verfälscht die Farben: Standard wählen",
        "ビュー変換 {} で色が変わります: 標準 を選択",
    ),
    "Wireframe shading hides the colours": (
        "Drahtgitter-Schattierung verdeckt die Farben",
        "ワイヤーフレーム表示では色が見えません",
    ),
}
"""English, German, Japanese."""


def in_own_context(classes: Iterable[type]) -> None:
    """Let the properties of classes that are still to be registered be translated in this context."""
    for cls in classes:
        for deferred in getattr(cls, "__annotations__", {}).values():
            deferred.keywords.setdefault("translation_context", CONTEXT)


def translated(words: str) -> str:
    """Words that are drawn into the view, in the language of the interface."""
    return str(bpy.app.translations.pgettext_iface(words, CONTEXT))


def catalogue() -> dict[str, dict[tuple[str, str], str]]:
    """As Blender wants it: of each language the words by context and English."""
    return {
        language: {(context, english): words[k] for english, words in WORDS.items() for context in (CONTEXT, "*")}
        for k, language in enumerate(LANGUAGES)
    }


def register() -> None:
    """Make the words known to Blender."""
    bpy.app.translations.register(__package__, catalogue())


def unregister() -> None:
    """Take them away again."""
    bpy.app.translations.unregister(__package__)


CLASSES = ()
