"""Waypoints whose least snap no vehicle should fly."""

DIPS = """x,y,z
0.000,-1.000,2.000
-12.778,-12.242,2.395
-11.766,-8.213,7.787
-14.837,13.611,9.323
-0.132,-2.753,2.596
9.651,4.154,10.789
-7.096,-13.277,5.887
0.266,11.491,1.447
"""
"""All a metre high or more, and the least snap leads 1.03 m below the ground."""
