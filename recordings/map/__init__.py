"""The saved map: a folder of Parquet tables that is replaced whole, verified when it is loaded. See FORMAT.md."""
