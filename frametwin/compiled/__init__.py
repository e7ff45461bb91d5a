"""Machine code of compiled loops: kept in files, and called without loading the compiler."""
