"""`handey bench motion`: motion planning measured on folders of problems and on random deep reaches, beside peers."""
