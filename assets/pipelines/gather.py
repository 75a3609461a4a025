"""One table (CSV) and one page of thumbnails of all captures: `gather.py RESULTS NAME...`."""

import csv
import html
import json
import os
import sys
from pathlib import Path

COLUMNS = [
    "capture", "status", "format", "views", "triangles", "warnings", "held-out PSNR dB", "held-out SSIM", "training PSNR dB",
    "fit seconds", "asked memory MiB", "message",
]


def read(path):
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return {"status": "missing"}


def score(result, name, key):
    for aggregate in result.get("aggregates") or []:
        if aggregate.get("name") == name:
            value = (aggregate.get("score") or {}).get("raw", {}).get(key)
            return round(value, 3) if isinstance(value, (int, float)) else ""
    return ""


def row_of(results, name):
    stages = {stage: read(results / name / f"{stage}.json") for stage in ("check", "fit", "relight", "score")}
    # What is told is the first stage that did not end well; those behind it were skipped.
    bad = next((stage for stage, result in stages.items() if result.get("status") != "done"), None)
    check, fit = stages["check"], stages["fit"]
    understood = check.get("understood") or {}
    warnings = [one for one in check.get("findings") or [] if str(one.get("severity")).lower() in ("warning", "fatal")]
    remedy = stages[bad].get("remedy", "") if bad else ""
    told = f"{bad}: {stages[bad].get('message', '')}{f' ({remedy})' if remedy else ''}" if bad else ""
    return stages, {
        "capture": name,
        "status": "done" if bad is None else f"{bad} {stages[bad].get('status')}",
        "format": understood.get("format", ""),
        "views": understood.get("views", ""),
        "triangles": understood.get("triangles", ""),
        "warnings": len(warnings),
        "held-out PSNR dB": score(stages["score"], "held-out views", "psnr_srgb_db"),
        "held-out SSIM": score(stages["score"], "held-out views", "ssim_srgb"),
        "training PSNR dB": score(stages["score"], "training views", "psnr_srgb_db"),
        "fit seconds": fit.get("seconds", ""),
        "asked memory MiB": (check.get("ask") or {}).get("memory_mib", ""),
        "message": told,
    }


def main():
    results, names = Path(sys.argv[1]), sys.argv[2:]
    gathered = [row_of(results, name) for name in names]
    with (results / "table.csv.part").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(row for _, row in gathered)
    cards = []
    for stages, row in gathered:
        pictures = [path for path in stages["relight"].get("pictures") or [] if Path(path).exists()][:4]
        shown = "".join(
            f'<img loading="lazy" src="{html.escape(os.path.relpath(path, results))}" alt="{html.escape(Path(path).stem)}">'
            for path in pictures
        )
        report = results / row["capture"] / "run" / "report.html"
        link = f'<a href="{html.escape(os.path.relpath(report, results))}">report</a>' if report.exists() else ""
        state = "done" if row["status"] == "done" else "failed"
        figures = f'{row["held-out PSNR dB"]} dB held out, {row["views"]} views' if row["views"] != "" else ""
        cards.append(
            f'<section class="{state}"><h2>{html.escape(row["capture"])}</h2><p>{html.escape(row["status"])} {link}</p>'
            f'<p>{html.escape(figures)}</p>{shown}<p>{html.escape(row["message"])}</p></section>'
        )
    done = sum(row["status"] == "done" for _, row in gathered)
    page = (
        '<!doctype html><meta charset="utf-8"><title>Captures</title><style>body{font:15px system-ui;margin:2rem}'
        "main{display:grid;grid-template-columns:repeat(auto-fill,minmax(20rem,1fr));gap:1rem}"
        "section{border:1px solid #8884;border-radius:8px;padding:1rem}section.failed{border-color:#c33}"
        "img{width:48%;margin:1%}</style>"
        f"<h1>{done} of {len(gathered)} captures done</h1><p><a href=\"table.csv\">table.csv</a></p><main>{''.join(cards)}</main>"
    )
    (results / "index.html.part").write_text(page)
    (results / "table.csv.part").replace(results / "table.csv")
    (results / "index.html.part").replace(results / "index.html")


if __name__ == "__main__":
    main()
