"""The paper's tables and figures made again: cases, the runs that measure them, and the page that shows them."""
