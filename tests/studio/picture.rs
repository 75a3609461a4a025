//! The picture widget, driven as a person drives it: by pointer, wheel and keys, in a window that is never opened.

#![allow(clippy::unwrap_used)]

use super::adapter::rendered;
use eframe::egui::{self, Event, Modifiers, MouseWheelUnit, PointerButton, Pos2, Shape, TouchPhase, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::{Vec2, Vec3};
use patina::image::display::DisplaySettings;
use patina::image::histogram::{Histogram, auto_exposure};
use patina::image::value_scale::{Palette, ValueScale};
use patina::image::{Image, RgbImage, area};
use patina::studio::picture::scale_bar::scale_bar;
use patina::studio::picture::widget::PictureResponse;
use patina::studio::picture::{
    self, Compare, Comparison, LineSpace, Lines, Mark, Overlay, PictureView, Place, Source, ThumbnailCache, Value,
};
use std::sync::Arc;

/// What the caller of the widget keeps.
struct Caller {
    source: Source,
    display: DisplaySettings,
    view: PictureView,
    comparison: Option<Comparison>,
    mask: Option<Arc<Image<bool>>>,
    lines: Vec<Lines>,
    marks: Vec<Mark>,
    badge: String,
    own_drag: bool,
    answer: Option<PictureResponse>,
    repaints: usize,
    /// The last of each, as they are told in one pass only.
    clicked: Option<Place>,
    drag: Option<(Place, Place)>,
}

impl Caller {
    fn new(source: Source) -> Self {
        Caller {
            source,
            display: DisplaySettings::default(),
            view: PictureView::default(),
            comparison: None,
            mask: None,
            lines: Vec::new(),
            marks: Vec::new(),
            badge: String::new(),
            own_drag: false,
            answer: None,
            repaints: 0,
            clicked: None,
            drag: None,
        }
    }

    fn ui(ui: &mut egui::Ui, caller: &mut Caller) {
        let overlay = Overlay {
            comparison: caller.comparison.clone(),
            mask: caller.mask.clone(),
            lines: &caller.lines,
            marks: &caller.marks,
            badge: &caller.badge,
            without_numbers: false,
            own_drag: caller.own_drag,
        };
        let answer = picture::show(ui, "Photo", &caller.source, &caller.display, &mut caller.view, &overlay);
        caller.repaints += usize::from(answer.repainted);
        caller.clicked = answer.clicked.or(caller.clicked);
        caller.drag = answer.drag.or(caller.drag);
        if let (Some(place), Some(comparison)) = (answer.wipe, &mut caller.comparison) {
            comparison.mode = Compare::Wipe(place);
        }
        caller.answer = Some(answer);
    }

    fn answer(&self) -> &PictureResponse {
        self.answer.as_ref().unwrap()
    }
}

/// A window of 400 x 300 points, filled by one picture.
fn window(caller: Caller, pixels_per_point: f32) -> Harness<'static, Caller> {
    let show = |ui: &mut egui::Ui, caller: &mut Caller| {
        // To the very border of the window, so that positions in tests are round numbers.
        let whole = ui.ctx().content_rect();
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(whole));
        ui.set_clip_rect(whole);
        Caller::ui(&mut ui, caller);
    };
    let mut harness = Harness::builder()
        .with_size(vec2(400.0, 300.0))
        .with_pixels_per_point(pixels_per_point)
        .with_max_steps(40)
        .wgpu()
        .build_ui_state(show, caller);
    harness.run();
    harness
}

fn colours(width: usize, height: usize, pixel: impl FnMut(usize, usize) -> Vec3) -> Source {
    Source::Colour(Arc::new(RgbImage::from_fn(width, height, pixel)))
}

/// Each texel tells its place.
fn map_of_places(width: usize, height: usize) -> Source {
    colours(width, height, |row, column| Vec3::new(row as f32, column as f32, 1.0) / 100.0)
}

fn hover(harness: &mut Harness<Caller>, position: Pos2) {
    harness.hover_at(position);
    harness.run();
}

fn scroll(harness: &mut Harness<Caller>, points: f32) {
    harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: vec2(0.0, points),
        phase: TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: Modifiers::NONE,
    });
    harness.run();
}

/// Words that are painted anywhere.
fn words(harness: &Harness<Caller>) -> Vec<String> {
    fn collect(shape: &Shape, words: &mut Vec<String>) {
        match shape {
            Shape::Text(text) => words.push(text.galley.text().to_owned()),
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| collect(shape, words)),
            _ => {}
        }
    }
    let mut all = Vec::new();
    harness.output().shapes.iter().for_each(|clipped| collect(&clipped.shape, &mut all));
    all
}

/// The colour at a point of the rendered window.
fn pixel(harness: &mut Harness<Caller>, position: Pos2, pixels_per_point: f32) -> [u8; 3] {
    let image = rendered(harness).unwrap();
    let [red, green, blue, _] =
        image.get_pixel((position.x * pixels_per_point) as u32, (position.y * pixels_per_point) as u32).0;
    [red, green, blue]
}

/// Keeps a picture to look at where the environment asks for it.
fn keep(harness: &mut Harness<'_, impl Sized>, name: &str) {
    if let Ok(folder) = std::env::var("PATINA_PICTURES") {
        rendered(harness).unwrap().save(format!("{folder}/picture_{name}.png")).unwrap();
    }
}

fn encoded(value: f32) -> u8 {
    patina::image::transfer::srgb8_from_linear_value(value)
}

fn assert_near(found: [u8; 3], expected: [u8; 3]) {
    let apart = (0..3).map(|channel| found[channel].abs_diff(expected[channel])).max().unwrap();
    assert!(apart <= 2, "{found:?} instead of {expected:?}");
}

#[test]
fn the_wheel_zooms_about_the_pointer_and_the_value_is_that_of_the_picture() {
    for pixels_per_point in [1.0, 2.0] {
        let mut harness = window(Caller::new(map_of_places(40, 30)), pixels_per_point);
        hover(&mut harness, pos2(123.0, 211.0));
        let before = harness.state().answer().hovered.unwrap();
        assert!((before.column - 12.3).abs() < 0.1 && (before.row - 21.1).abs() < 0.1, "{before:?}");
        for points in [200.0, 150.0, -90.0] {
            scroll(&mut harness, points);
            let answer = harness.state().answer();
            let after = answer.hovered.unwrap();
            let drift = (after.row - before.row).abs().max((after.column - before.column).abs());
            assert!(drift * answer.frame.zoom <= 1.0, "{drift} texels at zoom {}", answer.frame.zoom);
        }
        assert!(harness.state().answer().frame.zoom > 15.0 * pixels_per_point);
        let answer = harness.state().answer();
        assert_eq!(answer.value, Some(Value::Colour(Vec3::new(21.0, 12.0, 1.0) / 100.0)));
        assert!(answer.description().unwrap().starts_with("row    21  column    12"));
        let told = harness.get_by_label("Photo").value().unwrap();
        assert!(told.contains("0.210") && told.contains("0.120"), "{told}");
    }
}

#[test]
fn dragging_moves_the_picture_and_a_click_tells_the_place() {
    let mut harness = window(Caller::new(map_of_places(40, 30)), 1.0);
    harness.state_mut().view.set_zoom(40.0);
    harness.run();
    hover(&mut harness, pos2(200.0, 150.0));
    let before = harness.state().answer().hovered.unwrap();
    harness.drag_at(pos2(200.0, 150.0));
    harness.run();
    hover(&mut harness, pos2(280.0, 110.0));
    let under = harness.state().answer().hovered.unwrap();
    assert!(
        (under.row - before.row).abs() < 0.05 && (under.column - before.column).abs() < 0.05,
        "{under:?} {before:?}"
    );
    harness.drop_at(pos2(280.0, 110.0));
    harness.run();
    harness.state_mut().view.fit();
    harness.run();
    harness.get_by_label("Photo").click();
    harness.run();
    assert_eq!(harness.state().clicked.unwrap().texel(), Some((15, 20)));
}

#[test]
fn a_drag_can_be_left_to_the_caller_and_the_middle_button_still_moves() {
    let mut caller = Caller::new(map_of_places(40, 30));
    caller.own_drag = true;
    let mut harness = window(caller, 1.0);
    harness.drag_at(pos2(100.0, 100.0));
    harness.run();
    hover(&mut harness, pos2(160.0, 130.0));
    let (from, to) = harness.state().drag.unwrap();
    assert!((from.column - 10.0).abs() < 0.1 && (to.column - 16.0).abs() < 0.1 && (to.row - 13.0).abs() < 0.1);
    assert_eq!(harness.state().view.width_on_screen, None);
    harness.drop_at(pos2(160.0, 130.0));
    harness.run();
    let press = |pos: Pos2, pressed: bool| Event::PointerButton {
        pos,
        button: PointerButton::Middle,
        pressed,
        modifiers: Modifiers::NONE,
    };
    harness.event(press(pos2(160.0, 130.0), true));
    harness.run();
    hover(&mut harness, pos2(190.0, 130.0));
    assert!(harness.state().view.width_on_screen.is_some());
}

#[test]
fn numbers_stand_on_large_texels_only_and_texels_stay_sharp() {
    let mut harness = window(Caller::new(map_of_places(40, 30)), 1.0);
    assert!(words(&harness).is_empty(), "{:?}", words(&harness));
    for (zoom, has_numbers) in [(40.0, false), (64.0, true)] {
        harness.state_mut().view.set_zoom(zoom);
        harness.run();
        assert_eq!(words(&harness).iter().any(|words| words == "0.140\n0.190\n0.0100"), has_numbers, "zoom {zoom}");
    }
    keep(&mut harness, "numbers");
    // On both sides of a border between texels the colours are those of the texels, with nothing between.
    harness.state_mut().view.set_zoom(20.0);
    harness.run();
    let answer = harness.state().answer();
    let border = answer.position_of(Place { row: 14.5, column: 20.0 });
    for (offset, column) in [(-2.0, 19.0), (2.0, 20.0)] {
        let expected = [14.0, column, 1.0].map(|value: f32| encoded(value / 100.0));
        assert_near(pixel(&mut harness, border + vec2(offset, 0.0), 1.0), expected);
    }
}

#[test]
fn an_unchanged_panel_is_not_painted_again() {
    let mut harness = window(Caller::new(map_of_places(40, 30)), 1.0);
    assert_eq!(harness.state().repaints, 1);
    for step in 0..5 {
        hover(&mut harness, pos2(50.0 + step as f32, 60.0));
    }
    assert_eq!(harness.state().repaints, 1);
    harness.state_mut().display.exposure_stops = 1.0;
    harness.run();
    assert_eq!(harness.state().repaints, 2);
    harness.state_mut().source = map_of_places(40, 30);
    harness.run();
    assert_eq!(harness.state().repaints, 3);
}

#[test]
fn a_wipe_shows_both_pictures_and_its_divider_can_be_moved() {
    for pixels_per_point in [1.0, 2.0] {
        let mut caller = Caller::new(colours(40, 30, |_, _| Vec3::splat(0.5)));
        caller.comparison = Some(Comparison {
            other: colours(20, 15, |_, _| Vec3::new(0.1, 0.2, 0.8)),
            mode: Compare::Wipe(0.5),
            names: ["Photo".into(), "Fit".into()],
        });
        let mut harness = window(caller, pixels_per_point);
        let second = [0.1, 0.2, 0.8].map(encoded);
        assert_near(pixel(&mut harness, pos2(190.0, 60.0), pixels_per_point), [encoded(0.5); 3]);
        assert_near(pixel(&mut harness, pos2(210.0, 60.0), pixels_per_point), second);
        harness.get_by_label("Photo divider");
        harness.drag_at(pos2(200.0, 150.0));
        harness.run();
        hover(&mut harness, pos2(100.0, 150.0));
        harness.drop_at(pos2(100.0, 150.0));
        harness.run();
        assert_eq!(harness.state().comparison.as_ref().unwrap().mode, Compare::Wipe(0.25));
        assert_near(pixel(&mut harness, pos2(110.0, 60.0), pixels_per_point), second);
        // The picture itself was not moved.
        assert_eq!(harness.state().view.width_on_screen, None);
        hover(&mut harness, pos2(110.0, 60.0));
        let answer = harness.state().answer();
        assert_eq!(answer.other_value, Some(Value::Colour(Vec3::new(0.1, 0.2, 0.8))));
        keep(&mut harness, &format!("wipe_{pixels_per_point}"));
    }
}

#[test]
fn flip_and_difference_show_what_they_say() {
    let mut caller = Caller::new(colours(4, 3, |_, column| Vec3::splat(if column < 2 { 0.5 } else { 0.1 })));
    let other = colours(4, 3, |_, _| Vec3::splat(0.3));
    let names = ["Photo".to_owned(), "Fit".to_owned()];
    caller.comparison = Some(Comparison { other, mode: Compare::Flip(true), names });
    let mut harness = window(caller, 1.0);
    assert_near(pixel(&mut harness, pos2(85.0, 275.0), 1.0), [encoded(0.3); 3]);
    assert!(words(&harness).iter().any(|word| word == "Fit"));
    harness.state_mut().comparison.as_mut().unwrap().mode = Compare::Difference { signed: true, gain_stops: 1.0 };
    harness.run();
    let [red, green, _] = pixel(&mut harness, pos2(85.0, 275.0), 1.0);
    assert!(green > 150 && red < 50);
    let [red, green, _] = pixel(&mut harness, pos2(385.0, 275.0), 1.0);
    assert!(red > 150 && green < 50);
    keep(&mut harness, "difference");
}

#[test]
fn what_was_not_seen_is_hatched_and_has_no_value() {
    let scale = ValueScale::linear(0.0, 10.0);
    let image = Image::from_fn(40, 30, |row, column| if column < 20 { f32::NAN } else { row as f32 / 3.0 });
    let mut harness = window(Caller::new(Source::numbers(Arc::new(image), scale)), 1.0);
    hover(&mut harness, pos2(50.0, 50.0));
    assert!(harness.state().answer().description().unwrap().contains("no value"));
    let rendered = rendered(&mut harness).unwrap();
    let colours: std::collections::BTreeSet<[u8; 4]> = (20..60).map(|x| rendered.get_pixel(x, 200).0).collect();
    assert_eq!(colours.len(), 2, "a ground and a line: {colours:?}");
    keep(&mut harness, "unseen");
}

#[test]
fn marks_lines_masks_and_badges_are_drawn() {
    let mut caller = Caller::new(colours(64, 48, |row, column| Vec3::splat((row + column) as f32 / 112.0)));
    let square = [(0.2, 0.2), (0.7, 0.25), (0.6, 0.8), (0.2, 0.2)].map(|(u, v)| Vec2::new(u, v));
    let segments = square.windows(2).map(|ends| (ends[0], ends[1])).collect();
    let colour = egui::Color32::from_rgb(90, 200, 255);
    caller.lines = vec![Lines { segments: Arc::new(segments), space: LineSpace::Texture, colour }];
    caller.mask = Some(Arc::new(Image::from_fn(64, 48, |row, column| row > 36 && column > 40)));
    caller.marks = vec![Mark { place: Place { row: 12.5, column: 30.5 }, label: "P3".into(), colour }];
    caller.badge = "Diffuse".into();
    let mut harness = window(caller, 1.0);
    for word in ["P3", "Diffuse"] {
        assert!(words(&harness).iter().any(|found| found == word), "{word}");
    }
    // A corner of the border: u 0.2, v 0.2 from below.
    let corner = harness.state().answer().position_of(Place { row: 0.8 * 48.0, column: 0.2 * 64.0 });
    let [red, _, blue] = pixel(&mut harness, corner, 1.0);
    assert!(blue > red.saturating_add(30), "{red} {blue}");
    keep(&mut harness, "overlays");
}

#[test]
fn no_picture_is_too_strange() {
    let hard = [0.0, -1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX];
    for (width, height) in [(0, 0), (1, 1), (8192, 16), (16, 8192), (5, 0)] {
        for pixels_per_point in [1.0, 2.0] {
            let source = colours(width, height, |row, column| Vec3::splat(hard[(row + column) % hard.len()]));
            let mut caller = Caller::new(source.clone());
            let names = ["A".to_owned(), "B".to_owned()];
            caller.comparison = Some(Comparison { other: source, mode: Compare::Wipe(f32::NAN), names });
            let mut harness = window(caller, pixels_per_point);
            for points in [400.0, 4000.0, -9000.0] {
                hover(&mut harness, pos2(201.0, 151.0));
                scroll(&mut harness, points);
                harness.state_mut().view.zoom_in();
                harness.run();
            }
            assert!(harness.state().answer().frame.zoom.is_finite());
        }
    }
}

#[test]
fn the_small_ones_are_drawn_and_named() {
    let image = RgbImage::from_fn(300, 200, |row, column| {
        let sun = if row < 6 && column < 6 { 400.0 } else { 0.0 };
        Vec3::new(0.02 + row as f32 / 100.0, 0.5, 0.8) * (column as f32 / 150.0).powi(2) + Vec3::splat(sun)
    });
    let histogram = Histogram::of(&image);
    let display = DisplaySettings { exposure_stops: auto_exposure(&image), ..Default::default() };
    let mut thumbnails = ThumbnailCache::default();
    thumbnails.keep("first", &Arc::new(area::thumbnail(&image, 64)));
    thumbnails.keep("empty", &Arc::new(RgbImage::default()));
    let mut harness = Harness::builder().with_size(vec2(420.0, 300.0)).wgpu().build_ui(move |ui| {
        egui::CentralPanel::default().show(ui, |ui| {
            picture::histogram::show(ui, "Luminance", &histogram, &display, vec2(300.0, 80.0));
            scale_bar(ui, "Error scale", &ValueScale::linear(0.0, 0.25), Palette::Scale, "radiance");
            scale_bar(ui, "Count scale", &ValueScale::logarithmic(1.0, 1e4), Palette::Diverging, "");
            scale_bar(ui, "One value", &ValueScale::linear(2.0, 2.0), Palette::Grey, "m");
            let first = thumbnails.texture(ui.ctx(), "first", &display).unwrap().clone();
            assert_eq!(first.size(), [64, 43]);
            assert_eq!(thumbnails.texture(ui.ctx(), "first", &display).unwrap().id(), first.id());
            assert!(thumbnails.texture(ui.ctx(), "empty", &display).is_none());
            assert!(thumbnails.texture(ui.ctx(), "none", &display).is_none());
            ui.add(egui::Image::new(&first).alt_text("first"));
        });
    });
    harness.run();
    assert!(harness.get_by_label("Luminance").value().unwrap().contains("above white"));
    assert!(harness.get_by_label("Error scale").value().unwrap().starts_with("0 to 0.250 radiance"));
    assert!(harness.get_by_label("Count scale").value().unwrap().contains("logarithmic"));
    keep(&mut harness, "small_ones");
}
