"""MCAP: recordings read as one stream, whole, cut or damaged, and written."""
