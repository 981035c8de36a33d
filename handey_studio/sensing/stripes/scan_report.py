"""What a scan and a calibration found, as plain JSON and as lines to read."""

from typing import Any

import numpy as np

from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.stripes.calibrate import Calibration
from handey_studio.sensing.stripes.instrument import Instrument
from handey_studio.sensing.stripes.scan import Scan, outside_area


def scan_report(scan: Scan, instrument: Instrument, depth_map: DepthMap | None, timing: dict[str, float]) -> dict[str, Any]:
    """The scan as plain JSON, schema `handey/scan/1`; `depth_map` is None when nothing was read."""
    report: dict[str, Any] = {
        "schema": "handey/scan/1",
        "photographs": len(scan.looks),
        "stripes": scan.stripes,
        "points": len(scan.points_range),
        "dropped": scan.dropped,
        "noise_px": scan.noise_px,
        "noise_m": scan.noise,
        "cameras": [
            {"name": name, "laser": colour.name, "stripes_run": direction}
            for name, colour, direction in zip(instrument.names, scan.colours, scan.directions, strict=True)
        ],
        "depth_map": None,
        "timing_s": timing,
    }
    if depth_map is not None:
        report["outside_area"] = outside_area(scan, instrument)
        report["depth_map"] = {
            "shape": list(depth_map.elevation.shape),
            "cell_m": depth_map.cell,
            "read_share": float(np.isfinite(depth_map.elevation).mean()),
            "T_world_range": depth_map.T_world_range.tolist(),
        }
    return report


def scan_lines(report: dict[str, Any]) -> list[str]:
    """A scan's report as lines to read."""
    lines = [f"{report['photographs']} photographs, a stripe in {report['stripes']}"]
    for camera in report["cameras"]:
        name = f"camera {camera['name']}: " if camera["name"] else ""
        lines.append(f"  {name}{camera['laser']} laser, stripes run {camera['stripes_run']}")
    dropped = ", ".join(f"{count} {reason}" for reason, count in report["dropped"].items())
    lines.append(f"  {report['points']} peaks kept{f'; rows without: {dropped}' if dropped else ''}")
    lines.append(f"  noise of a peak {report['noise_px']:.3f} px, of a reading's height {1e3 * report['noise_m']:.3f} mm")
    if report["depth_map"] is not None:
        rows, columns = report["depth_map"]["shape"]
        cell, share = 1e3 * report["depth_map"]["cell_m"], report["depth_map"]["read_share"]
        lines.append(f"  depth map {columns} × {rows} cells of {cell:g} mm, {share:.0%} read; {report['outside_area']} readings outside")
    return lines


def calibration_report(found: Calibration) -> dict[str, Any]:
    """A calibration as plain JSON for the instrument's file: what was used, and how well it agrees."""
    camera, step = found.instrument.cameras[0], found.instrument.rig_step
    return {
        "focal_px": camera.focal_px,
        "corners_rms_px": float(np.sqrt(np.mean(np.square(list(found.camera_rms_px.values()))))),
        "camera_rms_px": found.camera_rms_px,
        "laser": found.colour.name,
        "plane_rms_m": found.plane_rms,
        "stripe_rms_m": found.stripe_rms,
        "board_rms_m": found.board_rms,
        "board_m_per_px": found.board_per_px,
        "spread_m": found.spread,
        "tilt_deviation_deg": float(np.rad2deg(found.tilt_deviation)),
        "table": found.table,
        "rig_step_m": None if step is None else step[:3, 3].tolist(),
        "left_out": found.left_out,
    }


def calibration_lines(report: dict[str, Any]) -> list[str]:
    """A calibration's report as lines to read."""
    views, stripes = report["camera_rms_px"], report["stripe_rms_m"]
    worst, bent = max(views, key=views.__getitem__), max(stripes, key=stripes.__getitem__)
    lines = [
        f"camera from {len(views)} photographs: focal length {report['focal_px']:.1f} px, corners {report['corners_rms_px']:.3f} px rms, "
        f"worst {views[worst]:.3f} ({worst})",
        f"{report['laser']} laser on {len(stripes)} boards: stripes lie {1e3 * report['plane_rms_m']:.3f} mm rms off one plane, worst "
        f"{1e3 * stripes[bent]:.3f} ({bent}); they spread {1e3 * report['spread_m']:.1f} mm, so its tilt is known to "
        f"{report['tilt_deviation_deg']:.3f}°",
        f'z = 0 is the board of photograph "{report["table"]}"',
    ]
    if report["board_rms_m"]:
        off = sorted(report["board_rms_m"].values())
        lines.insert(
            2,
            f"by the other boards' laser plane each stripe lies {1e3 * off[len(off) // 2]:.2f} mm rms off its board (median; worst "
            f"{1e3 * off[-1]:.2f}); a stripe read a pixel off is {1e3 * report['board_m_per_px']:.2f} mm there",
        )
    if report["rig_step_m"] is not None:
        lines.append("the rig steps by " + ", ".join(f"{1e3 * value:.4f}" for value in report["rig_step_m"]) + " mm")
    return lines + [f"  left out: {name}: {reason}" for name, reason in report["left_out"].items()]
