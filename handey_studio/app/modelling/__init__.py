"""§1 on screen: a part is modelled from scans by clicks. The state holds what is looked at; the geometry is in `modeling`."""
