"""The layout of the viewer, which every log contains: map and text log left; WiFi, check and back end right."""

import rerun as rr
import rerun.blueprint as rrb


def blueprint() -> rrb.Blueprint:
    """The views over `/map`, `/wifi`, `/check`, `/backend` and `/log`."""
    left = rrb.Vertical(_map(), _log(), row_shares=[3, 1])
    right = rrb.Vertical(_wifi(), _check(), _backend(), row_shares=[5, 4, 3])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[1, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="stamp", play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _map() -> rrb.View:
    return rrb.Spatial2DView(origin="/", contents="/map/**", name="Map")


def _log() -> rrb.View:
    columns = rrb.TextLogColumns(timeline_columns=["keyframe"], text_log_columns=["loglevel", "body"])
    return rrb.TextLogView(origin="/log", name="Verdicts, state, warnings", columns=columns)


def _wifi() -> rrb.Container:
    rssi = rrb.BarChartView(origin="/wifi/rssi", name="RSSI by AP, dB above -100 dBm")
    strongest = rrb.TextDocumentView(origin="/wifi/strongest", name="Strongest APs")
    similarity = rrb.BarChartView(origin="/wifi/similarity", name="Similarity to earlier fingerprints")
    places = rrb.Spatial2DView(origin="/", contents=["/map/grid", "/wifi/places/**"], name="Similar fingerprints")
    sequences = rrb.Spatial2DView(
        origin="/", contents=["/map/grid", "/wifi/sequences/**"], name="Sequences of the last candidate"
    )
    return rrb.Vertical(
        rrb.Horizontal(similarity, rrb.Tabs(rssi, strongest)), rrb.Horizontal(places, sequences), name="WiFi"
    )


def _check() -> rrb.Container:
    before = rrb.Spatial2DView(
        origin="/", contents=["/check/scans/submap", "/check/scans/before"], name="Check: before"
    )
    after = rrb.Spatial2DView(origin="/", contents=["/check/scans/submap", "/check/scans/after"], name="Check: after")
    result = rrb.TextDocumentView(origin="/check/result", name="Result")
    ratio = _curves(
        origin="/check/inlier_ratio", name="Inlier ratio", y=rrb.ScalarAxis(range=(0.0, 1.0), zoom_lock=True)
    )
    return rrb.Horizontal(before, after, rrb.Vertical(ratio, result), name="Check")


def _backend() -> rrb.Container:
    factors = _curves(origin="/backend/factors/in_and_out", name="Factors in and out")
    residual = _curves(origin="/backend/residual", name="Residual")
    time = _curves(origin="/backend/time", name="Time of a stage, ms")
    sigma = _curves(origin="/backend/sigma", name="One sigma of the pose")
    total = _curves(origin="/backend/factors/total", name="Factors in the graph")
    calibration = _curves(origin="/backend/calibration", name="Calibration")
    state = rrb.StateTimelineView(origin="/backend/state", name="State")
    return rrb.Horizontal(
        rrb.Tabs(residual, total, calibration), rrb.Tabs(factors, time, sigma), state, name="Back end"
    )


def _curves(origin: str, name: str, y: rrb.ScalarAxis | None = None) -> rrb.View:
    """Curves over the whole drive; Rerun's default shows only some seconds around the cursor."""
    whole = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=rrb.TimeAxis(view_range=whole), axis_y=y)
