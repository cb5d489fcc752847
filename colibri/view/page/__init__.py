"""The page itself, by viser, which no other room imports: server, scene, plots, controls."""
