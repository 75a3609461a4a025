#!/usr/bin/env bash
# Drives the real window under Xvfb as a person would, by keys, and takes a picture of every panel.
#
#   bash tests/studio_screenshots.sh OUT [SCENE] [SECONDS OF FIT] [smoke|strip]
#
# With `smoke` it opens, fits, relights and closes, in a minute or so. With `strip` it takes one picture of the window at 1, 2,
# 5, 10, 20 and 30 s after opening, as many after starting a fit, and one at its end, and lays them out in `strip.png`.
#
# With README_PICTURES=screenshots the README's pictures of the window are made of them.
#
# SCENE is a scene folder; without one, or when it is not there, the built-in demo. Needs the Debian packages
# xvfb xdotool imagemagick mesa-vulkan-drivers libxcursor1 libxi6 libxkbcommon-x11-0 libx11-xcb1.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(realpath -m "${1:?folder for the pictures}")
scene=${2:-}; fit_seconds=${3:-45}
program=${PATINA:-target/release/patina}
mkdir -p "$out"
work=$(mktemp -d)
for tool in Xvfb xdotool import; do
  command -v "$tool" >/dev/null || { echo "skipped: $tool is not installed"; exit 0; }
done
[ -x "$program" ] || cargo build --release

display=:87
Xvfb "$display" -screen 0 1600x1000x24 >/dev/null 2>&1 & server=$!
export DISPLAY="$display"
sleep 1
cleanup() { kill "${studio:-$server}" "$server" 2>/dev/null || true; rm -rf "$work"; }
trap cleanup EXIT

# Where runs go and how large the window is, as a person would have chosen them before.
printf '{"runs-folder": "%s/runs", "window-size": [1600, 1000], "theme": "%s"}' "$work" "${THEME:-dark}" >"$work/studio.json"
opening=(--demo)
if [ -n "$scene" ] && [ -d "$scene" ]; then opening=("$scene"); else echo 'the built-in demo is opened'; fi
"$program" studio --settings-file "$work/studio.json" "${opening[@]}" >"$work/log" 2>&1 & studio=$!

alive() {
  kill -0 "$studio" 2>/dev/null && return 0
  local code=0
  wait "$studio" || code=$?
  echo "the window is gone, exit code $code, last act: ${last_act:-none}"
  cat "$work/log"
  exit 1
}
picture() { alive; sleep "${2:-0.6}"; import -window root "$out/$1.png"; echo "$out/$1.png"; }
keys() { alive; xdotool key --delay 60 "$@"; sleep 0.4; }
# An act by its name, through the palette.
act() { last_act=$1; keys ctrl+k; sleep 0.8; xdotool type --delay 30 "$1"; sleep 1.2; keys Return; sleep 0.6; }
title() { xdotool getwindowname "$(xdotool search --onlyvisible --class patina | head -1)" 2>/dev/null || true; }
wait_for_title() { # pattern of grep -E, seconds
  for _ in $(seq "$(( $2 * 2 ))"); do
    alive
    if title | grep -qiE -- "$1"; then return 0; fi
    sleep 0.5
  done
  echo "the title never held '$1': $(title)"
  act 'Messages panel'; picture why_not
  cat "$work/log"; exit 1
}

# Without a window manager nobody gives the window the keys.
for _ in $(seq 120); do
  alive
  window=$(xdotool search --onlyvisible --class patina | head -1) && [ -n "$window" ] && break
  sleep 0.5
done
xdotool windowfocus "$window"
# Pictures at these seconds after a moment, of which the first may have passed.
at_seconds() { # name, moment in seconds since 1970
  for second in 1 2 5 10 20 30; do
    left=$(echo "$2 + $second - $(date +%s.%N)" | bc)
    case "$left" in -*) left=0 ;; esac
    picture "$(printf '%s_%02d_s' "$1" "$second")" "$left"
  done
}
if [ "${4:-}" = strip ]; then
  at_seconds strip_open "$(date +%s.%N)"
  wait_for_title ' - Patina' 600
  act 'Start fit'
  at_seconds strip_fit "$(date +%s.%N)"
  wait_for_title 'Finished' 1800
  picture strip_fit_end 2
  montage +label "$out"/strip_open_*.png "$out"/strip_fit_*.png -resize 640x -tile 4x -geometry +4+4 "$out/strip.png"
else
picture 01_welcome 2
wait_for_title ' - Patina' 600
picture 02_scene_is_read 3
# The atlas is made beside the window; starting is refused until it is there.
for _ in $(seq 600); do
  act 'Start fit'
  sleep 2
  case "$(title)" in *[Ff]itting*|*Finished*) break ;; esac
done
wait_for_title "fitting|Finished" 300
sleep "$fit_seconds"
picture 03_fitting
fi
if [ "${4:-}" = smoke ]; then
  act 'Environment panel'; picture 04_environment
  act 'Scores panel'; picture 05_scores
  keys Right; picture 06_next_environment 2
  keys F1; picture 07_keys 2; keys Escape
  act 'Stop fit'
  wait_for_title 'Stopped|Finished' 300
  picture 08_stopped
fi
if [ "${4:-}" != smoke ] && [ "${4:-}" != strip ]; then
act 'Diffuse'; picture 04_stage_diffuse
act 'Roughness'; picture 05_stage_roughness
act 'Shaded'
act 'Environment panel'; picture 06_light
act 'Photos panel'; picture 07_photos
act 'Pause'
# A quick machine may have finished the demo by now.
wait_for_title 'paused|Finished' 300
picture 08_paused_and_traced 12
act 'Next environment'; picture 09_second_light 10
act 'Next environment'; picture 10_third_light 10
act 'Next environment'; picture 11_fourth_light 10
act 'Previous environment'; sleep 1
act 'Compare environments'; picture 12_two_lights 20
act 'Compare environments'
act 'Estimated environment'
act "Look through the photo's camera"; picture 13_through_a_photo 10
act 'Photo / render wipe'; picture 14_photo_wiped 2
act 'Photo / render wipe'
act 'Frame all'
act 'Show camera thumbnails'; picture 15_cameras 8
act 'Photo panel'; picture 16_photo 2
act 'Viewport panel'
act 'Compute residuals'
sleep 2
act 'Maps panel'
act 'Show UV islands'; picture 17_maps
act 'Show UV islands'
act 'Relight panel'; picture 18_relight
act 'Lighting contact sheet'; sleep 12; picture 18_strip
act 'Texel panel'
xdotool mousemove 800 540 click 1; sleep 8; picture 19_texel
act 'Messages panel'; picture 20_messages
act 'Scores panel'; picture 21_scores
act 'Curves panel'; picture 21_curves
act 'False colour'; picture 22_false_colour 6
act 'Reset display'
keys ctrl+k; sleep 1; xdotool type --delay 60 'light'; picture 23_palette 2; keys Escape; sleep 1
keys F1; picture 24_help 3; keys Escape; sleep 1
act 'Render image'; picture 25_save 3; keys Escape; sleep 1
act 'Show residuals'
picture 26_photo_error 30
act 'Shaded'
for theme in 27 28 29; do act 'Cycle theme'; picture "${theme}_theme" 3; done
if title | grep -qi paused; then
  act 'Pause'; sleep 3
  act 'Stop fit'
fi
wait_for_title 'Stopped|Finished' 300
picture 30_stopped
fi
# From here on the window may go: that is what is asked for.
alive() { return 0; }
act 'Quit'
for _ in $(seq 60); do kill -0 "$studio" 2>/dev/null || break; sleep 0.5; done
if kill -0 "$studio" 2>/dev/null; then echo 'the window did not close'; exit 1; fi
wait "$studio" || { echo "the window closed with exit code $?"; cat "$work/log"; exit 1; }
studio=$server
if [ -n "${README_PICTURES:-}" ]; then
  for pair in 03_fitting:fitting 12_two_lights:two_lights 14_photo_wiped:photo_wiped 19_texel:texel; do
    convert "$out/${pair%%:*}.png" -quality 88 "$README_PICTURES/window_${pair##*:}.jpg"
  done
fi
echo 'done'
