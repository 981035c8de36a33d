"""§3: the light-stripe range finder, from photographs and chessboards to the depth map."""
