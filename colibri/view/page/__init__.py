"""The page in viser: server, scene, plots, controls."""
