//! The manners of a good tool: undo, the palette, themes, help, zoom, the stage alone.

use super::support::{Key, Modifiers, TestStudio};
use egui_kittest::kittest::NodeT;
use patina::image::histogram::auto_exposure;
use patina::studio::act::{Act, LIST};
use patina::studio::model::Dialog;
use patina::studio::model::lights::LightName;
use patina::studio::model::store::ThemeChoice;
use patina::studio::stage::Navigation;
use patina::studio::workspace::Panel;

/// Frames until a change counts as one step of undo.
const SETTLED: usize = 6;

#[test]
fn undo_and_redo_by_key_and_by_menu_show_in_the_fields() {
    let mut studio = TestStudio::with_small_scene();
    studio.frames(SETTLED);
    studio.type_number("Samples", "8");
    studio.frames(SETTLED);
    studio.move_slider("Intensity (EV)", 1.5);
    studio.frames(SETTLED);
    studio.press(Modifiers::COMMAND, Key::Z);
    assert_eq!((studio.number("Intensity (EV)"), studio.number("Samples")), (0.0, 8.0));
    studio.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(studio.number("Samples"), 2.0);
    studio.click("Edit");
    studio.click_first("Redo");
    assert_eq!((studio.number("Intensity (EV)"), studio.number("Samples")), (0.0, 8.0));
    studio.press(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
    assert_eq!(studio.number("Intensity (EV)"), 1.5);
    studio.press(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
    assert!(studio.log().contains("Redo: nothing to redo"), "{}", studio.log());
}

#[test]
fn undo_within_a_text_belongs_to_the_text() {
    let mut studio = TestStudio::with_small_scene();
    studio.type_number("Samples", "8");
    studio.frames(SETTLED);
    studio.click("All settings");
    studio.replace_text("Find a setting", "rate");
    studio.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(studio.number("Samples"), 8.0);
    // Nor does a letter that is typed do an act.
    studio.press(Modifiers::NONE, Key::X);
    assert!(studio.model().edits.fit.exclude.is_empty());
}

#[test]
fn the_palette_is_opened_typed_in_and_obeyed_by_keys() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::COMMAND, Key::K);
    studio.type_text("next env");
    studio.press(Modifiers::NONE, Key::Enter);
    assert_eq!(studio.model().dialog, Dialog::None);
    assert_ne!(studio.model().edits.relight.first, LightName::Fitted);
    studio.press(Modifiers::COMMAND, Key::K);
    studio.type_text("layer that is not there");
    assert!(studio.says("No matching command"));
    studio.press(Modifiers::NONE, Key::Enter);
    studio.press(Modifiers::NONE, Key::Escape);
    assert_eq!(studio.model().dialog, Dialog::None);
    // By arrows: the second of those found.
    studio.press(Modifiers::COMMAND, Key::K);
    studio.type_text("rotate env");
    studio.press(Modifiers::NONE, Key::ArrowDown);
    studio.press(Modifiers::NONE, Key::Enter);
    assert_eq!(studio.model().edits.relight.turn_degrees, 345.0, "the other way is the second");
}

#[test]
fn each_theme_draws_every_panel() {
    let mut studio = TestStudio::with_finished_run();
    let mut grounds = Vec::new();
    for _ in ThemeChoice::NAMED {
        studio.press(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::T);
        for (panel, title, _) in Panel::ALL {
            studio.show(panel);
            assert!(!studio.controls(title).is_empty(), "{title}");
        }
        let visuals = studio.harness.ctx.global_style().visuals.clone();
        grounds.push((studio.model().preferences.theme, visuals.panel_fill, visuals.text_color()));
    }
    assert_eq!(studio.model().preferences.theme, ThemeChoice::System, "around");
    let of = |theme| grounds.iter().find(|(own, ..)| *own == theme).map(|(_, ground, text)| (*ground, *text)).unwrap();
    let (dark, light, strong) = (of(ThemeChoice::Dark), of(ThemeChoice::Light), of(ThemeChoice::HighContrast));
    assert!(dark.0.r() < 64 && light.0.r() > 200 && strong.0.r() == 0 && strong.1.r() == 255, "{grounds:?}");
}

#[test]
fn help_lists_every_act_and_closes() {
    let mut studio = TestStudio::new();
    studio.frames(1);
    studio.press(Modifiers::NONE, Key::F1);
    for info in LIST {
        assert!(studio.says(info.name) && studio.says(info.help), "{}", info.name);
    }
    studio.click("Close");
    assert_eq!(studio.model().dialog, Dialog::None);
    studio.press(Modifiers::NONE, Key::Questionmark);
    assert_eq!(studio.model().dialog, Dialog::Help);
}

#[test]
fn the_interface_grows_one_step_a_press() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::COMMAND, Key::Plus);
    assert!((studio.harness.ctx.zoom_factor() - 1.1).abs() < 1e-4, "{}", studio.harness.ctx.zoom_factor());
    for _ in 0..30 {
        studio.press(Modifiers::COMMAND, Key::Minus);
    }
    assert!(studio.harness.ctx.zoom_factor() >= 0.6);
    studio.control("Fit again");
    studio.press(Modifiers::COMMAND, Key::Num0);
    assert_eq!(studio.harness.ctx.zoom_factor(), 1.0);
}

#[test]
fn the_stage_stands_alone_and_everything_comes_back() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::SHIFT, Key::Tab);
    assert!(studio.controls("Fit again").is_empty() && studio.controls("Edit").is_empty());
    studio.press(Modifiers::SHIFT, Key::Tab);
    studio.control("Fit again");
    // A panel that is asked for shows, even from the stage alone.
    studio.press(Modifiers::SHIFT, Key::Tab);
    studio.press(Modifiers::COMMAND, Key::Num2);
    studio.control("Exclude");
}

#[test]
fn the_layout_is_put_back() {
    let mut studio = TestStudio::with_finished_run();
    let first = studio.harness.state().layout.visible();
    for panel in [Panel::Views, Panel::Photo, Panel::Light, Panel::Record, Panel::Scores] {
        studio.show(panel);
    }
    assert_ne!(studio.harness.state().layout.visible(), first);
    studio.act(Act::ResetLayout);
    assert_eq!(studio.harness.state().layout.visible(), first);
}

#[test]
fn display_keys_change_what_they_say() {
    let mut studio = TestStudio::with_finished_run();
    let before = studio.model().edits.display;
    studio.press(Modifiers::NONE, Key::E);
    assert_eq!(studio.number("Display exposure"), f64::from(before.exposure_stops) + 0.25);
    studio.press(Modifiers::SHIFT, Key::E);
    studio.press(Modifiers::SHIFT, Key::E);
    assert_eq!(studio.number("Display exposure"), f64::from(before.exposure_stops) - 0.25);
    studio.press(Modifiers::NONE, Key::K);
    studio.press(Modifiers::NONE, Key::L);
    studio.press(Modifiers::NONE, Key::Z);
    let display = studio.model().edits.display;
    assert!(display.curve != before.curve && display.false_colour && display.stripes);
    studio.press(Modifiers::NONE, Key::R);
    assert_eq!(studio.model().edits.display, patina::image::display::DisplaySettings::default());
    studio.press(Modifiers::NONE, Key::N);
    let project = studio.model().project.as_ref().unwrap();
    let measured = auto_exposure(&project.thumbnails[project.chosen_view]);
    assert!(measured != 0.0 && measured.abs() <= 20.0, "{measured}");
    assert_eq!(studio.model().edits.display.exposure_stops, measured);
}

/// A studio in a window of its own size, at a scale of the interface.
fn sized(size: [f32; 2], zoom: f32) -> TestStudio {
    let builder = egui_kittest::Harness::builder().with_size(size);
    let folder = std::sync::Arc::new(tempfile::tempdir().unwrap());
    let mut studio = TestStudio::built(builder, folder, Some(super::support::finished_run().into()));
    studio.harness.ctx.set_zoom_factor(zoom);
    studio.wait("the run", |model| model.project.is_some());
    studio.frames(3);
    studio
}

#[test]
fn a_small_window_and_large_letters_leave_dialogs_within_the_window() {
    for (size, zoom) in [([900.0, 600.0], 1.0), ([1440.0, 900.0], 1.7), ([900.0, 600.0], 1.7)] {
        let mut studio = sized(size, zoom);
        let within = studio.harness.ctx.content_rect().expand(1.0);
        for (act, labels) in [
            (Act::Palette, vec!["Type a command"]),
            (Act::SavePicture, vec!["Save", "Image file"]),
            (Act::Export, vec!["Export folder"]),
            (Act::OpenFolder, vec!["Open this"]),
        ] {
            studio.act(act);
            studio.frames(3);
            for label in labels {
                studio.control(label).scroll_to_me();
                studio.frames(6);
                let rect = studio.control(label).rect();
                assert!(within.contains_rect(rect), "{act:?} {size:?} {zoom}: {label} {rect:?} {within:?}");
            }
            studio.model().dialog = Dialog::None;
            studio.frames(2);
        }
    }
}

#[test]
fn the_palette_keeps_its_height_while_one_types() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::COMMAND, Key::K);
    studio.frames(3);
    let field = studio.control("Type a command").rect();
    studio.type_text("layer that is not there");
    studio.frames(3);
    assert_eq!(studio.control("Type a command").rect(), field, "what is typed stays where it is");
}

#[test]
fn the_first_stop_of_tab_is_the_main_button_and_it_wears_a_ring() {
    let mut studio = TestStudio::new();
    studio.frames(2);
    studio.press(Modifiers::NONE, Key::Tab);
    assert!(studio.control("Open the built-in demo").accesskit_node().is_focused());
    // From there Tab goes on, and does not come back by itself.
    studio.press(Modifiers::NONE, Key::Tab);
    assert!(!studio.control("Open the built-in demo").accesskit_node().is_focused());
}

#[test]
fn hand_movements_are_chosen_in_the_menu_and_remembered() {
    let mut studio = TestStudio::with_finished_run();
    studio.click_first("View");
    studio.click("Navigation as in");
    studio.line("Navigate as in Blender").click();
    studio.frames(3);
    assert_eq!(studio.model().preferences.navigation, Navigation::Blender);
    studio.act(Act::Help);
    studio.frames(2);
    assert!(studio.says("Middle-drag to orbit, Shift-middle-drag to pan"));
    studio.model().dialog = Dialog::None;
    let folder = studio.close();
    let mut again = TestStudio::in_folder(folder, None);
    again.frames(1);
    assert_eq!(again.model().preferences.navigation, Navigation::Blender);
}
