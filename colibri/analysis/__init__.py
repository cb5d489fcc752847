"""What a flight left behind, joined, judged, drawn, tabled."""
