//! The window as it is seen, drawn by whatever adapter there is. Properties of pixels are held, not the pixels: every
//! adapter rounds in its own way.

use super::adapter::{has_adapter, rendered};
use super::object::write_sphere_photo;
use super::support::{Key, Modifiers, Role, TestStudio, finished_run};
use eframe::egui::{Event, PointerButton, Pos2, Rect, vec2};
use egui_kittest::Harness;
use image::RgbaImage;
use patina::object::starts::ModelKind;
use patina::studio::act::Act;
use patina::studio::model::LightName;
use patina::studio::model::object_form::Effort;
use patina::studio::model::store::ThemeChoice;
use patina::studio::workspace::Panel;
use std::path::PathBuf;
use std::sync::Arc;

/// A window that is drawn, with the finished run open.
fn drawn(size: [f32; 2], pixels_per_point: f32) -> TestStudio {
    let builder =
        Harness::builder().with_size(size).with_pixels_per_point(pixels_per_point).with_render_cursor(false).wgpu();
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let mut studio = TestStudio::built(builder, folder, Some(finished_run().into()));
    studio.wait("the run", |model| model.project.is_some());
    studio.frames(3);
    studio
}

/// The whole window. Where `PATINA_WINDOW_PICTURES` names a folder, the picture is kept there, to be looked at.
fn picture(studio: &mut TestStudio, name: &str) -> RgbaImage {
    // What was uploaded for one frame is on the screen in the next.
    for _ in 0..3 {
        studio.frames(1);
        rendered(&mut studio.harness).unwrap();
    }
    let picture = rendered(&mut studio.harness).unwrap();
    if let Some(folder) = std::env::var_os("PATINA_WINDOW_PICTURES") {
        picture.save(PathBuf::from(folder).join(format!("window_{name}.png"))).unwrap();
    }
    picture
}

fn stage_rect(studio: &TestStudio) -> Rect {
    studio.control("Scene in 3-D").rect()
}

/// Pixels of a part of the window.
fn part(picture: &RgbaImage, rect: Rect, pixels_per_point: f32) -> Vec<[u8; 3]> {
    let side = |value: f32| (value * pixels_per_point) as u32;
    let (left, right) = (side(rect.left()), side(rect.right()).min(picture.width()));
    let (top, bottom) = (side(rect.top()), side(rect.bottom()).min(picture.height()));
    let pixels = (top..bottom).flat_map(|row| (left..right).map(move |column| (column, row)));
    pixels.map(|(column, row)| picture.get_pixel(column, row)).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

/// Share of pixels that differ by more than rounding.
fn share_changed(before: &[[u8; 3]], after: &[[u8; 3]]) -> f64 {
    assert_eq!(before.len(), after.len());
    let differ = |(a, b): &(&[u8; 3], &[u8; 3])| (0..3).any(|channel| a[channel].abs_diff(b[channel]) > 6);
    before.iter().zip(after).filter(differ).count() as f64 / before.len() as f64
}

/// The middle of the stage, where the things stand.
fn middle(rect: Rect) -> Rect {
    Rect::from_center_size(rect.center(), rect.size() * eframe::egui::vec2(0.4, 0.3))
}

/// Mean brightness of blocks of so many pixels a side: the noise of a path tracer is less than a shadow there.
fn blocks(picture: &RgbaImage, rect: Rect) -> Vec<f32> {
    const SIDE: u32 = 6;
    let (left, top) = (rect.left() as u32, rect.top() as u32);
    let (columns, rows) = (rect.width() as u32 / SIDE, rect.height() as u32 / SIDE);
    let brightness = |pixel: &image::Rgba<u8>| pixel.0[..3].iter().map(|byte| f32::from(*byte)).sum::<f32>() / 3.0;
    let mean = |row: u32, column: u32| {
        let pixels = (0..SIDE * SIDE).map(|index| (column * SIDE + index % SIDE, row * SIDE + index / SIDE));
        let sum: f32 = pixels.map(|(x, y)| brightness(picture.get_pixel(left + x, top + y))).sum();
        sum / (SIDE * SIDE) as f32
    };
    (0..rows).flat_map(|row| (0..columns).map(move |column| mean(row, column))).collect()
}

/// The pixels of a part of the window once they are as they should be: large pictures are made ready beside the window.
#[track_caller]
fn once(studio: &mut TestStudio, name: &str, rect: Rect, is_so: impl Fn(&[[u8; 3]]) -> bool) -> Vec<[u8; 3]> {
    for _ in 0..60 {
        let pixels = part(&picture(studio, name), rect, 1.0);
        if is_so(&pixels) {
            return pixels;
        }
        std::thread::sleep(std::time::Duration::from_millis(30));
    }
    panic!("{name}: the picture did not become what it should; {}", studio.log());
}

#[test]
fn the_sun_is_dragged_and_two_balls_show_the_light() {
    if !has_adapter() {
        return;
    }
    let mut studio = drawn([1440.0, 900.0], 1.0);
    studio.click_role(Role::RadioButton, "Noon sky");
    studio.frames(3);
    let (from, turn) = (studio.control("Sun").rect().center(), studio.number("Rotation"));
    let drag_sun = |studio: &mut TestStudio, from: Pos2, to: Pos2| {
        let button = |pos, pressed| {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            Event::PointerButton { pos, button, pressed, modifiers }
        };
        studio.harness.event(Event::PointerMoved(from));
        studio.frames(1);
        studio.harness.event(button(from, true));
        for share in [0.3, 0.7, 1.0] {
            studio.harness.event(Event::PointerMoved(from + share * (to - from)));
            studio.frames(2);
        }
        studio.harness.event(button(to, false));
        studio.frames(3);
    };
    // The sun of noon stands over the stage: it goes along its border.
    let to = from + vec2(60.0, 0.0);
    drag_sun(&mut studio, from, to);
    let at = studio.control("Sun").rect().center();
    assert_ne!(studio.number("Rotation"), turn);
    assert!((at - to).length() < 8.0, "the sun follows the hand: {at:?} in place of {to:?}");
    // That of a sky by the hour goes along its way over the day, and the sky does not turn.
    studio.click_role(Role::RadioButton, "Sky by the hour");
    studio.frames(3);
    let (from, turn, hour) =
        (studio.control("Sun").rect().center(), studio.number("Rotation"), studio.model().edits.relight.day.hour);
    let towards = if from.x > stage_rect(&studio).center().x { -60.0 } else { 60.0 };
    drag_sun(&mut studio, from, from + vec2(towards, 0.0));
    assert_ne!(studio.model().edits.relight.day.hour, hour);
    assert_eq!(studio.number("Rotation"), turn);
    // A light without a sun has no handle.
    studio.click_role(Role::RadioButton, "Overcast sky");
    studio.frames(3);
    assert!(studio.controls("Sun").is_empty() && studio.controls("Chrome ball").is_empty());
    studio.click("Reference balls");
    studio.frames(3);
    studio.control("Chrome ball");
    studio.control("Grey ball, 18 %");
}

#[test]
#[ignore = "slow: drawn by the processor"]
fn the_stage_shows_the_mesh_and_changes_with_layer_and_light() {
    if !has_adapter() {
        return;
    }
    let mut studio = drawn([1024.0, 640.0], 1.0);
    let rect = stage_rect(&studio);
    let lit = once(&mut studio, "fitted", rect, |pixels| {
        let colours: std::collections::HashSet<_> = pixels.iter().collect();
        colours.len() > 500
    });
    let again = part(&picture(&mut studio, "fitted"), rect, 1.0);
    assert!(share_changed(&lit, &again) < 0.002, "nothing changed, nothing moves");

    // An estimated light is smooth: what changes is little, but over all of the background.
    let share_unlike = |before: &[[u8; 3]], after: &[[u8; 3]]| {
        before.iter().zip(after).filter(|(before, after)| before != after).count() as f64 / before.len() as f64
    };
    studio.click("Blurred");
    let out_of_focus = once(&mut studio, "out of focus", rect, |pixels| share_unlike(&lit, pixels) > 0.1);
    studio.click("Blurred");
    once(&mut studio, "in focus", rect, |pixels| share_unlike(&out_of_focus, pixels) > 0.1);

    studio.press(Modifiers::NONE, Key::Num2);
    let diffuse = once(&mut studio, "diffuse", rect, |pixels| share_changed(&lit, pixels) > 0.3);
    studio.press(Modifiers::NONE, Key::Num5);
    let normal = once(&mut studio, "normal", rect, |pixels| share_changed(&diffuse, pixels) > 0.1);

    studio.click_role(Role::RadioButton, "Evening sky");
    assert_eq!(studio.model().edits.relight.first, LightName::Sky("evening".into()));
    let is_evening = |pixels: &[[u8; 3]]| share_changed(&lit, pixels) > 0.3 && share_changed(&normal, pixels) > 0.3;
    once(&mut studio, "evening", rect, is_evening);
    // Things that are lit from another side, where they stand.
    let things = middle(rect);
    let before = part(&picture(&mut studio, "evening"), things, 1.0);
    for _ in 0..6 {
        studio.press(Modifiers::SHIFT, Key::ArrowLeft);
    }
    once(&mut studio, "evening_turned", things, |pixels| share_changed(&before, pixels) > 0.1);
    studio.press(Modifiers::NONE, Key::Home);
    once(&mut studio, "fitted_again", rect, |pixels| share_changed(&lit, pixels) < 0.01);
    studio.press(Modifiers::NONE, Key::M);
    // One half is as before.
    let is_half = |pixels: &[[u8; 3]]| (0.1..0.9).contains(&share_changed(&lit, pixels));
    once(&mut studio, "two_lights", rect, is_half);
}

/// Moves the mouse with the button down, in steps.
fn drag(studio: &mut TestStudio, from: Pos2, to: Pos2, modifiers: Modifiers) {
    drag_by(studio, PointerButton::Primary, from, to, modifiers);
}

/// The same with another button.
fn drag_by(studio: &mut TestStudio, button: PointerButton, from: Pos2, to: Pos2, modifiers: Modifiers) {
    let button = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers };
    studio.harness.event_modifiers(Event::PointerMoved(from), modifiers);
    studio.harness.event_modifiers(button(from, true), modifiers);
    for step in 1..=5 {
        let at = from.lerp(to, step as f32 / 5.0);
        studio.harness.event_modifiers(Event::PointerMoved(at), modifiers);
    }
    studio.harness.event_modifiers(button(to, false), modifiers);
    studio.frames(3);
}

#[test]
fn a_drag_orbits_with_shift_it_turns_the_light_and_a_click_pins_a_texel() {
    if !has_adapter() {
        return;
    }
    let mut studio = drawn([1440.0, 900.0], 1.0);
    let rect = stage_rect(&studio);
    let (eye, from) = (studio.model().eye, rect.center());
    let to = from + eframe::egui::vec2(60.0, 0.0);
    drag(&mut studio, from, to, Modifiers::SHIFT);
    let turned = studio.model().edits.relight.turn_degrees;
    assert!((turned - 24.0).abs() < 3.0, "60 points turn by 24 degrees, not {turned}");
    assert_eq!(studio.model().eye, eye, "the eye stays");
    drag(&mut studio, from, to, Modifiers::NONE);
    assert_ne!(studio.model().eye, eye);
    assert_eq!(studio.model().edits.relight.turn_degrees, turned, "the light stays");
    // The middle button orbits, and pans with Shift, as in Blender.
    let eye = studio.model().eye;
    drag_by(&mut studio, PointerButton::Middle, from, to, Modifiers::NONE);
    let orbited = studio.model().eye;
    assert!(orbited.yaw_radians != eye.yaw_radians && orbited.target == eye.target, "{orbited:?}");
    drag_by(&mut studio, PointerButton::Middle, from, to, Modifiers::SHIFT);
    let panned = studio.model().eye;
    assert!(panned.yaw_radians == orbited.yaw_radians && panned.target != orbited.target, "{panned:?}");
    assert_eq!(studio.model().edits.relight.turn_degrees, turned, "the environment stays");
    studio.press(Modifiers::NONE, Key::F);

    // The line between two lights is dragged by its grip.
    studio.press(Modifiers::NONE, Key::M);
    drag(&mut studio, rect.center(), rect.center() - eframe::egui::vec2(0.25 * rect.width(), 0.0), Modifiers::NONE);
    let wipe = studio.model().edits.relight.wipe;
    assert!((wipe - 0.25).abs() < 0.03, "{wipe}");
    studio.press(Modifiers::NONE, Key::M);

    studio.press(Modifiers::NONE, Key::V);
    for pressed in [true, false] {
        studio.harness.event(Event::PointerMoved(from));
        let button = PointerButton::Primary;
        studio.harness.event(Event::PointerButton { pos: from, button, pressed, modifiers: Modifiers::NONE });
    }
    studio.frames(3);
    assert!(studio.model().cursor.is_some_and(|cursor| cursor.pinned), "the middle of the scene is surface");
    assert!(studio.says("Pinned texel"), "its record comes to the front");
}

#[test]
#[ignore = "slow: paths traced until they have settled"]
fn the_traced_preview_takes_the_place_of_the_quick_look_and_shadows_appear() {
    if !has_adapter() {
        return;
    }
    let mut studio = drawn([1024.0, 640.0], 1.0);
    studio.click_role(Role::RadioButton, "Noon sky");
    assert_eq!(studio.model().edits.relight.first, LightName::Sky("noon".into()));
    let rect = middle(stage_rect(&studio));
    let quick = blocks(&picture(&mut studio, "quick"), rect);
    studio.press(Modifiers::NONE, Key::T);
    assert!(studio.model().switches.traced);
    let mut darker = 0.0;
    for _ in 0..120 {
        std::thread::sleep(std::time::Duration::from_millis(20));
        studio.frames(1);
        let traced = blocks(&picture(&mut studio, "traced"), rect);
        let count = quick.iter().zip(&traced).filter(|(before, after)| **before - **after > 15.0).count();
        darker = count as f64 / quick.len() as f64;
        if darker > 0.03 {
            break;
        }
    }
    assert!(darker > 0.03, "only {darker} of the things lie in shadow; {}", studio.log());
}

/// Draws the window in a size and themes, and every panel in it.
fn draw_in(size: [f32; 2], pixels_per_point: f32, name: &str, themes: &[(ThemeChoice, &str)]) {
    if !has_adapter() {
        return;
    }
    let mut studio = drawn(size, pixels_per_point);
    for &(theme, word) in themes {
        studio.model().preferences.theme = theme;
        let picture = picture(&mut studio, &format!("{name}_{word}"));
        assert_eq!(picture.width(), (size[0] * pixels_per_point) as u32);
        let window = Rect::from_min_size(Pos2::ZERO, size.into());
        let colours: std::collections::HashSet<_> = part(&picture, window, pixels_per_point).into_iter().collect();
        assert!(colours.len() > 1000, "{name} {word}: {} colours", colours.len());
    }
    for (panel, title, _) in Panel::ALL {
        studio.show(panel);
        if std::env::var_os("PATINA_WINDOW_PICTURES").is_some() {
            picture(&mut studio, &format!("{name}_panel_{}", title.to_lowercase()));
        }
        let rect = studio.controls(title).last().unwrap().rect();
        assert!(rect.right() <= size[0] && rect.bottom() <= size[1], "{title} at {rect:?}");
    }
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted);
}

const THEMES: [(ThemeChoice, &str); 3] =
    [(ThemeChoice::Dark, "dark"), (ThemeChoice::Light, "light"), (ThemeChoice::HighContrast, "strong")];

#[test]
#[ignore = "slow: drawn by the processor three times"]
fn the_window_is_drawn_in_every_theme() {
    draw_in([1024.0, 640.0], 1.0, "1024", &THEMES);
}

#[test]
#[ignore = "slow where the processor draws"]
fn the_window_is_drawn_large_and_in_fine_pixels() {
    draw_in([1440.0, 900.0], 1.0, "1440", &THEMES);
    draw_in([1024.0, 640.0], 2.0, "1024_twice", &THEMES);
}

/// Clicks through object mode and draws it: what a person sees after an estimation, and of the library.
#[test]
#[ignore = "slow: an estimation, and drawn by the processor"]
fn object_mode_is_drawn_with_its_result_and_its_library() {
    if !has_adapter() {
        return;
    }
    let size = [1440.0, 900.0];
    let builder = Harness::builder().with_size(size).with_render_cursor(false).wgpu();
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let photo = folder.path().join("ball.exr");
    // Pictures that are kept are to be looked at: larger, and by the model that the program takes by itself.
    let is_kept = std::env::var_os("PATINA_WINDOW_PICTURES").is_some();
    write_sphere_photo(&photo, if is_kept { 128 } else { 32 });
    let mut studio = TestStudio::built(builder, folder, None);
    studio.act(Act::ObjectWorkspace);
    let empty = picture(&mut studio, "object_empty");
    let form = &mut studio.model().edits.object;
    (form.photos, form.effort) = (vec![photo], Effort::Quick);
    if !is_kept {
        (form.model, form.light_rows, form.pixels) = (ModelKind::CookTorrance, Some(16), Some(300));
    }
    studio.frames(2);
    studio.act(Act::ObjectStart);
    studio.wait("the first look", |model| model.object.look.is_some() || model.object.outcome.is_some());
    picture(&mut studio, "object_running");
    studio.wait("the relit pictures", |model| !model.object.relit.is_empty());
    studio.act(Act::PanelRelit);
    let window = Rect::from_min_size(Pos2::ZERO, size.into());
    let whole = picture(&mut studio, "object_finished");
    let changed = share_changed(&part(&empty, window, 1.0), &part(&whole, window, 1.0));
    assert!(changed > 0.2, "only {changed} of the window changed");
    for name in ["Photo of the object", "Re-render of the object", "Sphere of the estimated reflectance"] {
        let rect = studio.control(name).rect();
        let colours: std::collections::HashSet<_> = part(&whole, rect, 1.0).into_iter().collect();
        assert!(colours.len() > 40, "{name}: {} colours in {rect:?}", colours.len());
    }
    studio.click("Log error");
    studio.act(Act::PanelObjectLight);
    studio.act(Act::PanelStarts);
    picture(&mut studio, "object_log_error");

    studio.act(Act::PanelMaterials);
    studio.wait("the materials", |model| !model.materials.thumbnails.is_empty());
    studio.act(Act::NextMaterial);
    studio.wait("the material", |model| model.materials.shown.is_some());
    studio.act(Act::PanelMaterial);
    picture(&mut studio, "object_materials");
    studio.act(Act::PanelMaterialMap);
    let map = picture(&mut studio, "object_map");
    let rect = studio.control("Map of the latent codes").rect();
    let colours: std::collections::HashSet<_> = part(&map, rect, 1.0).into_iter().collect();
    assert!(colours.len() > 500, "{} colours on the map", colours.len());
    for (theme, word) in THEMES {
        studio.model().preferences.theme = theme;
        picture(&mut studio, &format!("object_{word}"));
    }
    // No tab reaches out of the window.
    for (_, title, act) in Panel::OBJECT {
        studio.act(act);
        let rect = studio.controls(title).last().unwrap().rect();
        assert!(rect.right() <= size[0] && rect.bottom() <= size[1], "{title} at {rect:?}");
    }
}
