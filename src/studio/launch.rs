//! Opening the window, or saying in one sentence why there is none.

use super::app::{Studio, StudioOptions};
use super::model::store::Store;
use crate::error::{Error, ErrorKind, Result, text_of_panic};
use std::path::PathBuf;

/// The packages of Debian that a window needs at run time, for the remedy of an error.
const DEBIAN_PACKAGES: &str = "libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 mesa-vulkan-drivers";

/// Opens the window and returns when it is closed.
///
/// # Errors
/// `Unsupported` when there is no display, or nothing on it can draw.
pub fn run(options: StudioOptions) -> Result<()> {
    let settings_file = options.settings_file.clone();
    open(settings_file, move |creation| Box::new(Studio::new(creation, &options)))
}

/// Opens a window around an app and returns when it is closed. `settings_file` is where its size is remembered, in place
/// of the user's own.
///
/// # Errors
/// As of [`run`].
pub(crate) fn open(
    settings_file: Option<PathBuf>,
    app: impl FnOnce(&eframe::CreationContext<'_>) -> Box<dyn eframe::App>,
) -> Result<()> {
    check_display()?;
    let store = settings_file.map_or_else(Store::of_user, |path| Store::at(Some(path)));
    let size = store.clone().read().0.window_size;
    let viewport = egui::ViewportBuilder::default()
        .with_title("Patina")
        .with_app_id("patina")
        .with_inner_size(size)
        .with_min_inner_size([640.0, 400.0])
        .with_drag_and_drop(true);
    // Dithering costs a seventh of a frame where the processor draws, and the window shows hardly a gradient of its own.
    let native =
        eframe::NativeOptions { viewport, renderer: eframe::Renderer::Wgpu, dithering: false, ..Default::default() };
    // A system library that is missing makes the window library panic: the person gets a sentence all the same.
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(move || {
        eframe::run_native("patina", native, Box::new(move |creation| Ok(app(creation))))
    }));
    match outcome {
        Ok(Ok(())) => Ok(()),
        Ok(Err(source)) => Err(no_window(&source.to_string())),
        Err(panic) => Err(no_window(text_of_panic(&*panic))),
    }
}

fn no_window(why: &str) -> Error {
    // Some libraries put the file of their source before the reason.
    let why = match why.rfind(".rs:") {
        Some(place) => why[place..].split_once(": ").map_or(why, |(_, reason)| reason),
        None => why,
    };
    Error::new(ErrorKind::Unsupported, format!("the window cannot be opened: {why}")).remedy(format!(
        "without a window: `patina demo` or `patina fit SCENE -o RUN`; on Debian a window needs: {DEBIAN_PACKAGES}"
    ))
}

/// An error where the system says that there is no display.
fn check_display() -> Result<()> {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(target_os = "linux") && !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") {
        return Err(Error::new(ErrorKind::Unsupported, "no display found")
            .remedy("use the command line, e.g. `patina fit SCENE -o RUN` (see `patina --help`)"));
    }
    Ok(())
}
