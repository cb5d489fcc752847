"""A geofence: uploaded, downloaded, cleared."""

import sys

from mavsdk.plugins.geofence import Circle, FenceType, Geofence, GeofenceData, Point, Polygon
from mavsdk.plugins.telemetry import Telemetry

from tests.clients.mavsdk_scripts.connection import connected, place, until

CORNERS_M = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
RADIUS_M = 3.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        telemetry, geofence = Telemetry(vehicle), Geofence(vehicle)
        until(lambda: telemetry.health().is_home_position_ok, "home")
        corners = [Point(*place(telemetry, *corner)) for corner in CORNERS_M]
        hole = Circle(Point(*place(telemetry, 10.0, 10.0)), RADIUS_M, FenceType.EXCLUSION)
        fence = GeofenceData([Polygon(corners, FenceType.INCLUSION)], [hole])
        geofence.upload_geofence(fence)
        geofence.clear_geofence()
        geofence.upload_geofence(fence)
        kept = geofence.download_geofence()
        assert [len(polygon.points) for polygon in kept.polygons] == [len(corners)]
        assert [(circle.radius, circle.fence_type) for circle in kept.circles] == [(RADIUS_M, FenceType.EXCLUSION)]
        for point, corner in zip(kept.polygons[0].points, corners, strict=True):
            assert abs(point.latitude_deg - corner.latitude_deg) < 1e-7
            assert abs(point.longitude_deg - corner.longitude_deg) < 1e-7


if __name__ == "__main__":
    main(sys.argv[1])
