//! Each panel, empty and filled.

use super::support::{Key, Modifiers, Role, TestStudio};
use eframe::egui::accesskit::Toggled;
use eframe::egui::{Event, PointerButton, Pos2};
use egui_kittest::kittest::NodeT;
use patina::error::{Finding, Place, Severity};
use patina::studio::act::Act;
use patina::studio::model::log::Message;
use patina::studio::panel::curves::stage_words;
use patina::studio::workspace::Panel;

#[test]
fn a_panel_that_has_nothing_to_show_says_what_would_fill_it() {
    let mut studio = TestStudio::with_small_scene();
    for (panel, what) in [
        (Panel::Maps, "No maps yet"),
        (Panel::Light, "No environment yet"),
        (Panel::Record, "No texel"),
        (Panel::Curves, "No data"),
        (Panel::Scores, "No scores yet"),
        // Without an adapter there is nothing to draw with.
        (Panel::Stage, "No 3-D rendering available"),
    ] {
        studio.show(panel);
        assert!(studio.says(what), "{what}");
    }
    studio.model().log.clear();
    studio.show(Panel::Messages);
    assert!(studio.says("No issues"));
}

#[test]
fn every_control_of_every_panel_has_a_name() {
    let mut studio = TestStudio::new();
    studio.frames(2);
    studio.harness.check_accessibility();
    let mut studio = TestStudio::with_finished_run();
    studio.act(Act::SecondLight);
    for (panel, title, _) in Panel::ALL {
        studio.show(panel);
        let unnamed = studio.harness.unnamed_widgets();
        assert!(unnamed.is_empty(), "{title}: {unnamed:#?}");
    }
}

#[test]
fn maps_are_switched_by_their_buttons() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Maps);
    assert!(studio.is_grey("Residual") && studio.is_grey("Inconsistency"), "not measured yet");
    let size = studio.control("Map").value().unwrap();
    assert!(size.contains("64 x 64"), "{size}");
    // The toolbar has buttons of the same names: those of the panel lie below it.
    for name in ["Specular", "Roughness", "Diffuse"] {
        let mine =
            studio.controls(name).into_iter().find(|node| node.rect().left() > 900.0 && node.rect().top() > 60.0);
        mine.unwrap().click();
        studio.frames(2);
        studio.control("Map");
    }
    studio.click_role(Role::Button, "View count");
    assert_eq!(studio.control_of(Role::Button, "View count").accesskit_node().toggled(), Some(Toggled::True));
    studio.click("UV seams");
    assert!(studio.model().switches.chart_borders);
    studio.press(Modifiers::NONE, Key::B);
    assert!(!studio.model().switches.chart_borders);
    studio.click("Fit view");

    studio.act(Act::SurfaceLayers);
    studio.wait_for_word("are projected onto the surface");
    studio.click("Residual");
    studio.click("Inconsistency");
    assert!(!studio.is_grey("Residual"));
}

#[test]
fn the_fitted_light_stands_against_the_true_one() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Light);
    assert!(studio.says("16 x 8 texels, mean radiance"));
    for picture in ["Environment map", "Mirror ball", "Grey ball"] {
        studio.control(picture);
    }
    studio.click("Against ground truth");
    studio.control("Environment map divider");
}

#[test]
fn a_photo_is_compared_with_its_render() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Photo);
    studio.control("Photo only");
    studio.click("Wipe");
    let mut waited = 0;
    while studio.controls("Photo divider").is_empty() {
        studio.frames(1);
        std::thread::sleep(std::time::Duration::from_millis(20));
        waited += 1;
        assert!(waited < 5000, "the render did not come; {}", studio.log());
    }
    let before = studio.number("Photo divider");
    studio.control("Photo divider").focus();
    studio.frames(2);
    studio.press(Modifiers::NONE, Key::ArrowRight);
    assert!(studio.number("Photo divider") > before, "the line is moved by keys too");
    for way in ["Difference", "Blink", "Overlay", "Photo only"] {
        studio.click(way);
        assert!(studio.controls("Photo divider").is_empty());
        assert_eq!(studio.controls("Opacity of the render").is_empty(), way != "Overlay", "{way}");
        if way == "Overlay" {
            studio.move_slider("Opacity of the render", 0.25);
            assert_eq!(studio.number("Opacity of the render"), 0.25);
        }
    }
    studio.click("Excluded pixels");
    let chosen = studio.model().project.as_ref().unwrap().chosen_view;
    studio.controls("Next").last().unwrap().click();
    studio.frames(2);
    assert_eq!(studio.model().project.as_ref().unwrap().chosen_view, chosen + 1);
    studio.press(Modifiers::NONE, Key::OpenBracket);
    assert_eq!(studio.model().project.as_ref().unwrap().chosen_view, chosen);
}

/// Names of the photos from top to bottom.
fn order(studio: &TestStudio) -> Vec<String> {
    let is_row = |node: &egui_kittest::Node<'_>| node.accesskit_node().role() == Role::RadioButton;
    let scene = studio.harness.state().model.project.as_ref().unwrap().scene.clone().unwrap();
    let names = scene.views.iter().flat_map(|view| {
        let name = view.name.clone();
        let rows = studio.controls(&format!("photo {name}"));
        rows.into_iter().filter(is_row).map(move |node| (node.rect().top(), name.clone())).collect::<Vec<_>>()
    });
    let mut names: Vec<(f32, String)> = names.collect();
    names.sort_by(|a, b| a.0.total_cmp(&b.0));
    names.into_iter().map(|(_, name)| name).collect()
}

#[test]
fn the_table_of_photos_sorts_chooses_and_looks_through() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Views);
    let by_name = order(&studio);
    assert_eq!(by_name.len(), 8);
    assert!(by_name.windows(2).all(|pair| pair[0] < pair[1]), "{by_name:?}");
    studio.click("Photo +");
    let mut backwards = by_name.clone();
    backwards.reverse();
    assert_eq!(order(&studio), backwards);
    studio.click("RMSE");
    let error = |studio: &TestStudio, name: &str| {
        let project = studio.harness.state().model.project.as_ref().unwrap();
        let index = project.scene.as_ref().unwrap().views.iter().position(|view| view.name == name).unwrap();
        project.view_errors[index].unwrap()
    };
    let errors: Vec<f32> = order(&studio).iter().map(|name| error(&studio, name)).collect();
    assert!(errors.windows(2).all(|pair| pair[0] >= pair[1]), "worst first: {errors:?}");
    assert!(studio.says("Test") && studio.says("Train"));

    let last = format!("photo {}", by_name[7]);
    studio.click(&last);
    let project = studio.model().project.as_ref().unwrap();
    assert_eq!(project.chosen_name(), Some(by_name[7].as_str()));
    let centre = studio.control(&last).rect().center();
    double_click(&mut studio, centre);
    assert!(studio.model().switches.looking_through);
    studio.press(Modifiers::NONE, Key::C);
    assert!(!studio.model().switches.looking_through);
}

/// Two clicks within one frame, quicker than the harness' clock.
fn double_click(studio: &mut TestStudio, at: Pos2) {
    studio.frames(4);
    let button =
        |pressed| Event::PointerButton { pos: at, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE };
    let events = [Event::PointerMoved(at), button(true), button(false), button(true), button(false)];
    studio.harness.input_mut().events.extend(events);
    studio.frames(3);
}

#[test]
fn a_texel_that_is_pinned_on_a_map_tells_what_every_photo_says() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Maps);
    studio.show(Panel::Record);
    // Some texel of the map belongs to a chart that photos see.
    let map = studio.control("Map").rect();
    let mut found = false;
    for place in 1..40 {
        let at = map.lerp_inside(eframe::egui::vec2(0.3 + 0.01 * place as f32, 0.25 + 0.012 * place as f32));
        for pressed in [true, false] {
            studio.harness.event(Event::PointerMoved(at));
            let button = PointerButton::Primary;
            studio.harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
        }
        studio.frames(3);
        if studio.says("Pinned texel") {
            found = true;
            break;
        }
    }
    assert!(found, "no texel could be pinned");
    let mut waited = 0;
    while !studio.says("Observations") {
        studio.frames(1);
        std::thread::sleep(std::time::Duration::from_millis(10));
        waited += 1;
        assert!(waited < 5000, "no record came; {}", studio.log());
    }
    for words in ["Texel row", "Roughness", "View count", "View spread", "Closest half-angle to light"] {
        assert!(studio.says(words), "{words}");
    }
    assert!(!studio.says("NaN"), "where there is no figure, words say why");
    studio.click("Unpin");
    assert!(studio.says("No texel") || studio.says("Texel under the cursor"));
}

#[test]
fn a_finding_with_a_place_is_a_link_that_goes_there() {
    let mut studio = TestStudio::with_small_scene();
    let name = studio.model().project.as_ref().unwrap().scene.as_ref().unwrap().views[3].name.clone();
    let finding = |place: Place, words: &str| Message::from(&Finding::new(Severity::Warning, "test", words).at(place));
    // The check has something to say of so small photos, which brought its panel to the front; nothing comes after it.
    studio.wait("what is found at the start", |model| !model.tasks.is_busy());
    studio.model().activate = Some(Panel::Curves);
    studio.frames(1);
    let log = &mut studio.model().log;
    log.clear();
    log.add(finding(Place::View(name.clone()), "this photo is dark"));
    log.add(finding(Place::Setting("rate-light".into()), "this rate is high"));
    studio.frames(1);
    assert!(studio.says("2 warnings"));
    studio.click("2 warnings");
    studio.frames(1);
    assert!(!studio.says("warning"), "looked at");
    assert!(studio.says("This photo is dark"));
    let link = Place::View(name.clone()).to_string();
    studio.click(&link);
    assert_eq!(studio.model().project.as_ref().unwrap().chosen_view, 3);
    assert!(studio.harness.state().layout.visible().contains(&Panel::Photo));
    let link = Place::Setting("rate-light".into()).to_string();
    studio.click(&link);
    assert!(studio.harness.state().layout.visible().contains(&Panel::Fit));
    assert!(!studio.controls("Rate light").is_empty(), "the form opens at the setting");
}

/// What a button puts on the clipboard.
fn copied_by(studio: &mut TestStudio, button: &str) -> String {
    studio.control(button).click();
    studio.harness.step();
    let commands = studio.harness.output().platform_output.commands.clone();
    let copied = commands.into_iter().find_map(|command| match command {
        eframe::egui::OutputCommand::CopyText(text) => Some(text),
        _ => None,
    });
    copied.unwrap_or_default()
}

#[test]
fn curves_are_drawn_over_steps_and_seconds_whole_and_by_stage() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Curves);
    assert!(studio.says("Held-out RMSE") && studio.controls("Log axis").is_empty(), "one line at first");
    let csv = copied_by(&mut studio, "Copy CSV");
    assert_eq!(csv.lines().count(), 1 + studio.model().fit.losses.len());
    let svg = copied_by(&mut studio, "Copy SVG");
    assert!(svg.contains("<svg") && svg.contains("held-out photos"), "{svg}");
    studio.click("Details");
    for control in ["X axis: Time", "Log axis", "X axis: Steps", "Log axis"] {
        studio.click(control);
    }
    let stage = studio.model().fit.losses[0].stage.clone();
    let stage = stage_words(&stage);
    studio.click("Phase of the fit");
    studio.click(&stage);
    assert_eq!(studio.control("Phase of the fit").value().as_deref(), Some(stage.as_str()));
    assert!(studio.says("Held-out RMSE"));
}

#[test]
#[ignore = "slow: pictures under every light"]
fn scores_under_other_lights_are_measured_when_asked_for() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Scores);
    studio.click("Compare under novel lighting");
    studio.wait("the comparison", |model| model.project.as_ref().is_some_and(|own| own.entanglement.is_some()));
    assert!(studio.says("lighting baked into the maps"), "{}", studio.log());
    assert!(studio.controls("Compare under novel lighting").is_empty());
}

#[test]
fn the_photo_lies_over_the_stage_and_against_it() {
    use patina::studio::model::edits::PhotoLook;
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::NONE, Key::G);
    assert_eq!((studio.model().edits.photo, studio.model().switches.looking_through), (PhotoLook::Over(1.0), true));
    studio.press(Modifiers::NONE, Key::W);
    assert_eq!(studio.model().edits.photo, PhotoLook::Wipe(0.5));
    studio.press(Modifiers::NONE, Key::C);
    assert_eq!((studio.model().edits.photo, studio.model().switches.looking_through), (PhotoLook::Off, false));
}

#[test]
fn a_message_has_a_button_where_the_terminal_names_a_flag() {
    let mut studio = TestStudio::with_small_scene();
    let name = studio.model().project.as_ref().unwrap().scene.as_ref().unwrap().views[2].name.clone();
    let finding = |remedy: &str| {
        Message::from(
            &Finding::new(Severity::Warning, "test", "photos differ").at(Place::View(name.clone())).remedy(remedy),
        )
    };
    studio.model().log.clear();
    studio.model().log.add(finding("fit a gain for each photo: --exposure; or leave it out: --exclude NAME"));
    studio.show(Panel::Messages);
    assert!(studio.says("Per-photo exposure compensation") && !studio.says("--exposure"), "{}", studio.log());
    assert!(!studio.model().edits.fit.exposure);
    studio.click("Turn exposure compensation on");
    assert!(studio.model().edits.fit.exposure);
    assert!(studio.controls("Turn exposure compensation on").is_empty(), "what was taken is no longer offered");
    studio.click(&format!("Exclude {name}"));
    assert_eq!(studio.model().edits.fit.exclude, [name]);
}

#[test]
fn reflectances_are_held_against_those_of_materials_that_exist() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Scores);
    assert!(studio.says("Plausibility"));
    // The same run with far too much shine.
    let project = studio.model().project.as_mut().unwrap();
    let mut maps = (**project.maps.as_ref().unwrap()).clone();
    maps.specular = maps.specular.map(|_| glam::Vec3::splat(0.136));
    maps.diffuse = maps.diffuse.map(|_| glam::Vec3::splat(0.5));
    project.maps = Some(std::sync::Arc::new(maps));
    studio.frames(2);
    assert!(studio.says("specular reflectance F0 is 0.136") || studio.says("Specular reflectance F0 is 0.136"));
    studio.control("Scale reflectance by 0.29");
}

#[test]
fn clipped_shares_are_told_once_rays_tell_the_object_from_the_sky() {
    let mut studio = TestStudio::with_scene_just_read();
    assert!(studio.model().project.as_ref().unwrap().clipped_shares.is_empty(), "a bright sky would count");
    studio.show(Panel::Views);
    studio.wait("the atlas", |model| model.project.as_ref().is_some_and(|own| own.surface.is_some()));
    assert_eq!(studio.model().project.as_ref().unwrap().clipped_shares.len(), 8);
}

#[test]
fn another_run_of_the_scene_stands_in_the_photo_s_place() {
    let mut studio = TestStudio::with_finished_run();
    studio.show(Panel::Photo);
    studio.click("Compare run…");
    studio.type_text(&super::support::finished_run().display().to_string());
    studio.click("Open this");
    studio.wait("the other run", |model| model.other_run.is_some());
    studio.frames(3);
    let name = studio.model().other_run.as_ref().unwrap().name.clone();
    studio.click("Against");
    studio.click_role(Role::Button, &name);
    assert_eq!(studio.control("Against").value().as_deref(), Some(name.as_str()));
    // A folder that is no run, or one of another scene, is refused with a remedy.
    studio.model().compare_with(super::support::small_scene().into());
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: "), "{}", studio.log());
    studio.model().close();
    assert!(studio.model().other_run.is_none());
}

#[test]
fn a_message_about_a_file_has_a_link_that_opens_it() {
    let mut studio = TestStudio::with_small_scene();
    let there = studio.folder.path().join("my picture.png");
    std::fs::write(&there, b"").unwrap();
    studio.model().log.clear();
    studio.model().log.note_of_file("Saved a picture", &there);
    let gone = studio.folder.path().join("gone.png");
    studio.model().log.note_of_file("Saved another", gone);
    studio.show(Panel::Messages);
    assert!(studio.controls("Open gone.png").is_empty());
    studio.control("Open my picture.png").click();
    studio.harness.step();
    let commands = studio.harness.output().platform_output.commands.clone();
    let opened = commands.into_iter().find_map(|command| match command {
        eframe::egui::OutputCommand::OpenUrl(url) => Some(url.url),
        _ => None,
    });
    assert!(opened.is_some_and(|url| url.starts_with("file://") && url.ends_with("my%20picture.png")));
}
