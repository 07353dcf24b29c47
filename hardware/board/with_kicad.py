# SPDX-License-Identifier: BSD-3-Clause
"""What KiCad itself does with the boards: fill, DRC, gerbers, drill files. And pictures of the
gerbers, by gerbv, which knows nothing of KiCad."""
from __future__ import annotations

import pathlib
import re
import shutil
import subprocess
import sys
import zipfile
from typing import Any, Callable

import compare_library
import kept
from boards import BOARDS
from model import Board

BUILD = kept.HARDWARE.parent / "build" / "hardware"
SEVERE = re.compile(r"\[(\w+)\]: (.*)\n    (?:Rule: .*|Local override); Severity: (\w+)")
PLOTS = (("F_Cu", "F.Cu"), ("In1_Cu", "In1.Cu"), ("In2_Cu", "In2.Cu"), ("B_Cu", "B.Cu"),
         ("F_Paste", "F.Paste"), ("F_Silkscreen", "F.SilkS"), ("B_Silkscreen", "B.SilkS"),
         ("F_Mask", "F.Mask"), ("B_Mask", "B.Mask"), ("Edge_Cuts", "Edge.Cuts"))
DATED = re.compile(r"CreationDate|^G04 Created by|^; DRILL file|date |^; #@! TF.CreationDate")


def pcbnew() -> Any:
    import pcbnew as module  # type: ignore  # pylint: disable=import-error
    return module


def filled(board: Board, work: pathlib.Path) -> Any:
    """A copy of the kept file, with its planes."""
    for suffix in ("kicad_pcb", "kicad_pro"):
        shutil.copy(kept.folder(board) / f"{board.name}.{suffix}", work)
    loaded = pcbnew().LoadBoard(str(work / f"{board.name}.kicad_pcb"))
    pcbnew().ZONE_FILLER(loaded).Fill(loaded.Zones())
    loaded.BuildConnectivity()
    return loaded


def design_rules(loaded: Any, report: pathlib.Path) -> list[str]:
    report.unlink(missing_ok=True)
    pcbnew().WriteDRCReport(loaded, str(report), pcbnew().EDA_UNITS_MILLIMETRES, True)
    text = report.read_text()
    found = [f"{kind}: {what}" for kind, what, _ in SEVERE.findall(text)]
    if "** Found " not in text or "unconnected pads **" not in text:
        found.append("KiCad wrote no report")
    return found


def moved_track(loaded: Any) -> None:
    tracks = [t for t in loaded.GetTracks() if t.GetClass() == "PCB_TRACK" and t.GetLength() > 3e6]
    tracks[len(tracks) // 2].Move(pcbnew().wxPointMM(0.9, 0.4))


def missing_via(loaded: Any) -> None:
    via = [t for t in loaded.GetTracks()
           if t.GetClass() == "PCB_VIA" and t.GetNetname() != "GND"][3]
    loaded.Delete(via)


def moved_part(loaded: Any) -> None:
    loaded.GetFootprints()[20].Move(pcbnew().wxPointMM(1.7, 1.1))


def thin_track(loaded: Any) -> None:
    next(t for t in loaded.GetTracks() if t.GetClass() == "PCB_TRACK").SetWidth(80000)


MISTAKES: tuple[tuple[str, Callable[[Any], None]], ...] = (
    ("clearance|shorting|crossing|dangling", moved_track), ("unconnected|dangling", missing_via),
    ("courtyards_overlap|clearance|shorting", moved_part), ("track_width", thin_track))


def unnoticed(board: Board, work: pathlib.Path) -> list[str]:
    faults = []
    for names, spoil in MISTAKES:
        loaded = filled(board, work)
        spoil(loaded)
        found = design_rules(loaded, work / "mistake.txt")
        if not any(re.search(names, fault) for fault in found):
            faults.append(f"KiCad's DRC does not find {spoil.__name__}: {found[:3]}")
    return faults


def plot(loaded: Any, board: Board, work: pathlib.Path) -> list[pathlib.Path]:
    """Gerbers with protel-free names and drill files, without dates."""
    target = work / "gerbers"
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    controller = pcbnew().PLOT_CONTROLLER(loaded)
    options = controller.GetPlotOptions()
    options.SetOutputDirectory(str(target))
    options.SetPlotFrameRef(False)
    options.SetUseGerberProtelExtensions(False)
    options.SetUseGerberX2format(True)
    options.SetSubtractMaskFromSilk(False)
    options.SetUseAuxOrigin(True)
    options.SetDrillMarksType(pcbnew().PCB_PLOT_PARAMS.NO_DRILL_SHAPE)
    options.SetPlotViaOnMaskLayer(False)  # vias are covered
    for name, layer in PLOTS:
        number = loaded.GetLayerID(layer)
        if layer.startswith("In") and board.layers == 2:
            continue
        controller.SetLayer(number)
        controller.OpenPlotfile(name, pcbnew().PLOT_FORMAT_GERBER, name)
        controller.PlotLayer()
    controller.ClosePlot()
    drill = pcbnew().EXCELLON_WRITER(loaded)
    drill.SetFormat(True)
    drill.SetOptions(False, False, loaded.GetDesignSettings().GetAuxOrigin(), False)
    drill.CreateDrillandMapFilesSet(str(target), True, False)
    files = sorted(target.iterdir())
    for file in files:
        kept_lines = [line for line in file.read_text().splitlines() if not DATED.search(line)]
        file.write_text("\n".join(kept_lines) + "\n")
    return files


def origin_faults(board: Board, work: pathlib.Path) -> list[str]:
    """Gerbers and drills have the origin of the placement file: the lower left corner."""
    edge = next((work / "gerbers").glob("*Edge_Cuts.gbr")).read_text()
    spots = [(int(x) / 1e6, int(y) / 1e6) for x, y in re.findall(r"X(-?\d+)Y(-?\d+)D0[12]", edge)]
    drill = "".join(path.read_text() for path in (work / "gerbers").glob("*-PTH.drl"))
    holes = [(float(x), float(y)) for x, y in re.findall(r"^X([-\d.]+)Y([-\d.]+)", drill, re.M)]
    faults = []
    for name, points in (("the outline", spots), ("a hole", holes)):
        wrong = [p for p in points if not (-0.01 <= p[0] <= board.width + 0.01 and
                                           -0.01 <= p[1] <= board.height + 0.01)]
        if wrong or not points:
            faults.append(f"{name} is at {wrong[:1]}, outside of the board as the placement has it")
    return faults


def archive(files: list[pathlib.Path], path: pathlib.Path) -> None:
    """The same files give the same archive."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for file in files:
            target.writestr(zipfile.ZipInfo(file.name, (2000, 1, 1, 0, 0, 0)), file.read_bytes(),
                            zipfile.ZIP_DEFLATED)


def content(path: pathlib.Path) -> dict[str, bytes]:
    if not path.is_file():
        return {}
    with zipfile.ZipFile(path) as source:
        return {name: source.read(name) for name in source.namelist()}


SIDES = {"front": ("F_Silkscreen", "F_Mask", "F_Cu"), "back": ("B_Silkscreen", "B_Mask", "B_Cu")}


def picture(board: Board, work: pathlib.Path, side: str, target: pathlib.Path) -> None:
    """Of one side, as one sees it: silk screen, mask openings, copper. Gerbers of the back are as
    seen through the board, so that side is mirrored."""
    silk, mask, copper = (str(next((work / "gerbers").glob(f"*{name}.gbr")))
                          for name in SIDES[side])
    edge = str(next((work / "gerbers").glob("*Edge_Cuts.gbr")))
    drills = [str(path) for path in sorted((work / "gerbers").glob("*.drl"))]
    layers = [*((path, "#FFFFFFFF") for path in drills), (silk, "#F5F5F0FF"), (mask, "#D8B75AB0"),
              (edge, "#F0F0F0FF"), (copper, "#1F7A4AFF")]
    arguments = [text for path, colour in layers for text in ("--foreground", colour, path)]
    mirror = ["--mirror=Y"] if side == "back" else []
    subprocess.run(["gerbv", *mirror, "--export=png", f"--output={target}", "--dpi=400x400",
                    "--border=2", "--background", "#0E4D2C", *arguments], check=True,
                   capture_output=True)


def produce(board: Board, loaded: Any, work: pathlib.Path, write: bool) -> list[str]:
    files = plot(loaded, board, work)
    archive(files, work / "gerbers.zip")
    target = kept.folder(board) / "production" / "gerbers.zip"
    if write:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(work / "gerbers.zip", target)
    for side in SIDES:
        picture(board, work, side, work / f"{side}.png")
        if write:
            images = kept.folder(board) / "images"
            images.mkdir(exist_ok=True)
            shutil.copy(work / f"{side}.png", images / f"{side}.png")
    faults = origin_faults(board, work)
    old, new = content(target), content(work / "gerbers.zip")
    return faults + [f"{name} in gerbers.zip is not what KiCad plots"
                     for name in sorted({*old, *new}) if old.get(name) != new.get(name)]


def one(name: str, write: bool) -> list[str]:
    board, _ = kept.open_board(name)
    work = BUILD / name
    work.mkdir(parents=True, exist_ok=True)
    loaded = filled(board, work)
    faults = design_rules(loaded, work / "drc.txt")
    print(f"{name}: DRC {len(faults)} faults, in {work / 'drc.txt'}")
    faults += produce(board, loaded, work, write)
    if name == "carrier":
        faults += unnoticed(board, work)
    return [f"{name}: {fault}" for fault in faults]


def run(write: bool = False) -> list[str]:
    """One process for each board: pcbnew keeps state."""
    faults = compare_library.faults()
    for name in BOARDS:
        done = subprocess.run([sys.executable, __file__, name, *(["--write"] if write else [])],
                              text=True, stdout=subprocess.PIPE, check=False)
        lines = done.stdout.splitlines()
        faults += [line for line in lines if line.startswith(f"{name}: ") and ": DRC" not in line]
        print("\n".join(line for line in lines if line not in faults))
        if done.returncode and not faults:
            faults.append(f"{name}: KiCad ended with {done.returncode}")
    return faults


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    problems = one(sys.argv[1], "--write" in sys.argv)
    print("\n".join(problems))
    sys.exit(bool(problems))
