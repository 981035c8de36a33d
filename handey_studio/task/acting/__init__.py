"""§2: a plan carried out in a cell: what is noticed, what is done about it, and the record of it all."""
