//! Colours and sizes, in one place. Nothing else in the studio names a colour.

use super::model::store::ThemeChoice;
use crate::error::Severity;
use crate::measured::Category;
use egui::{Color32, Context, CornerRadius, Stroke, Theme, ThemePreference, Vec2, Visuals, vec2};

/// Colours that mean something, beside those of egui.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// What is chosen, what goes on.
    pub accent: Color32,
    /// Text on the accent.
    pub on_accent: Color32,
    /// Something is well.
    pub good: Color32,
    /// Something may be wrong.
    pub warning: Color32,
    /// Something failed.
    pub error: Color32,
    /// Behind the mesh and around pictures.
    pub stage: Color32,
    /// Lines of plots, in order.
    pub curves: [Color32; 5],
    /// Lines of red, green and blue.
    pub channels: [Color32; 3],
}

/// Kinds of materials on the map, in the order of [`Category::ALL`]; in every theme the same, as on the saved map.
pub const KINDS: [Color32; 9] = [
    Color32::from_rgb(78, 121, 167),
    Color32::from_rgb(242, 142, 43),
    Color32::from_rgb(225, 87, 89),
    Color32::from_rgb(118, 183, 178),
    Color32::from_rgb(89, 161, 79),
    Color32::from_rgb(237, 201, 72),
    Color32::from_rgb(176, 122, 161),
    Color32::from_rgb(156, 117, 95),
    Color32::from_rgb(136, 136, 136),
];

const DARK: Palette = Palette {
    accent: Color32::from_rgb(95, 190, 168),
    on_accent: Color32::from_rgb(10, 24, 21),
    good: Color32::from_rgb(120, 200, 130),
    warning: Color32::from_rgb(235, 180, 80),
    error: Color32::from_rgb(240, 110, 100),
    stage: Color32::from_rgb(24, 26, 29),
    curves: [
        Color32::from_rgb(95, 190, 168),
        Color32::from_rgb(240, 170, 90),
        Color32::from_rgb(140, 165, 240),
        Color32::from_rgb(220, 130, 190),
        Color32::from_rgb(190, 195, 120),
    ],
    channels: [Color32::from_rgb(240, 110, 100), Color32::from_rgb(110, 200, 110), Color32::from_rgb(120, 155, 250)],
};

const LIGHT: Palette = Palette {
    accent: Color32::from_rgb(15, 118, 100),
    on_accent: Color32::WHITE,
    good: Color32::from_rgb(30, 120, 50),
    warning: Color32::from_rgb(150, 90, 0),
    error: Color32::from_rgb(185, 30, 25),
    stage: Color32::from_rgb(206, 209, 212),
    curves: [
        Color32::from_rgb(15, 118, 100),
        Color32::from_rgb(180, 95, 0),
        Color32::from_rgb(50, 80, 190),
        Color32::from_rgb(160, 40, 120),
        Color32::from_rgb(100, 105, 10),
    ],
    channels: [Color32::from_rgb(190, 35, 30), Color32::from_rgb(25, 125, 40), Color32::from_rgb(40, 70, 200)],
};

const HIGH_CONTRAST: Palette = Palette {
    accent: Color32::from_rgb(0, 255, 200),
    on_accent: Color32::BLACK,
    good: Color32::from_rgb(90, 255, 90),
    warning: Color32::from_rgb(255, 220, 0),
    error: Color32::from_rgb(255, 110, 110),
    stage: Color32::BLACK,
    curves: [
        Color32::from_rgb(0, 255, 200),
        Color32::from_rgb(255, 180, 0),
        Color32::from_rgb(140, 180, 255),
        Color32::from_rgb(255, 120, 230),
        Color32::WHITE,
    ],
    channels: [Color32::from_rgb(255, 110, 110), Color32::from_rgb(90, 255, 90), Color32::from_rgb(140, 180, 255)],
};

/// The palette of the theme in force.
pub fn palette(visuals: &Visuals) -> Palette {
    if visuals.override_text_color == Some(Color32::WHITE) {
        HIGH_CONTRAST
    } else if visuals.dark_mode {
        DARK
    } else {
        LIGHT
    }
}

impl Palette {
    /// The colour of a severity.
    pub fn of(&self, severity: Severity, text: Color32) -> Color32 {
        match severity {
            Severity::Note => text,
            Severity::Warning => self.warning,
            Severity::Fatal => self.error,
        }
    }
}

/// The colour of a kind of materials.
pub fn kind_colour(kind: Category) -> Color32 {
    let place = Category::ALL.iter().position(|own| *own == kind).unwrap_or(KINDS.len() - 1);
    KINDS[place.min(KINDS.len() - 1)]
}

/// Puts a theme in force.
pub fn apply(context: &Context, choice: ThemeChoice) {
    context.set_visuals_of(Theme::Light, visuals(Theme::Light, LIGHT, false));
    let strong = choice == ThemeChoice::HighContrast;
    let dark = if strong { HIGH_CONTRAST } else { DARK };
    context.set_visuals_of(Theme::Dark, visuals(Theme::Dark, dark, strong));
    context.set_theme(match choice {
        ThemeChoice::System => ThemePreference::System,
        ThemeChoice::Dark | ThemeChoice::HighContrast => ThemePreference::Dark,
        ThemeChoice::Light => ThemePreference::Light,
    });
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(8.0, 5.0);
        style.spacing.button_padding = vec2(8.0, 3.0);
        style.spacing.interact_size = vec2(36.0, 22.0);
        style.spacing.slider_width = 130.0;
        style.spacing.combo_width = 120.0;
        style.spacing.tooltip_width = 380.0;
        style.interaction.tooltip_delay = 0.4;
        style.interaction.selectable_labels = false;
    });
}

fn visuals(theme: Theme, palette: Palette, strong: bool) -> Visuals {
    let mut visuals = theme.default_visuals();
    let dark = theme == Theme::Dark;
    let grey = |dark_value: u8, light_value: u8| Color32::from_gray(if dark { dark_value } else { light_value });
    visuals.panel_fill = if strong { Color32::BLACK } else { grey(32, 244) };
    visuals.window_fill = if strong { Color32::BLACK } else { grey(38, 250) };
    visuals.extreme_bg_color = if strong { Color32::BLACK } else { grey(20, 255) };
    visuals.faint_bg_color = if strong { Color32::from_gray(20) } else { grey(39, 236) };
    visuals.override_text_color = strong.then_some(Color32::WHITE);
    if !strong {
        let text = grey(216, 30);
        for widget in [&mut visuals.widgets.noninteractive, &mut visuals.widgets.inactive] {
            widget.fg_stroke.color = text;
        }
        visuals.weak_text_color = Some(grey(160, 90));
    } else {
        visuals.weak_text_color = Some(Color32::from_gray(220));
        for widget in [
            &mut visuals.widgets.noninteractive,
            &mut visuals.widgets.inactive,
            &mut visuals.widgets.hovered,
            &mut visuals.widgets.active,
            &mut visuals.widgets.open,
        ] {
            widget.bg_stroke = Stroke::new(1.0, Color32::WHITE);
        }
        visuals.window_stroke = Stroke::new(2.0, Color32::WHITE);
    }
    visuals.selection.bg_fill =
        if dark { palette.accent.gamma_multiply(0.45) } else { palette.accent.gamma_multiply(0.3) };
    visuals.selection.stroke = Stroke::new(1.0, if dark { Color32::WHITE } else { Color32::BLACK });
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.error;
    visuals.slider_trailing_fill = true;
    visuals.striped = false;
    let radius = CornerRadius::same(4);
    visuals.window_corner_radius = CornerRadius::same(8);
    visuals.menu_corner_radius = CornerRadius::same(6);
    for widget in [
        &mut visuals.widgets.noninteractive,
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
        &mut visuals.widgets.open,
    ] {
        widget.corner_radius = radius;
    }
    visuals
}

/// Margin around the content of a panel, in points.
pub const PANEL_MARGIN: i8 = 10;
/// Size of a small picture of a light on the shelf, in points.
pub const SHELF_PICTURE: Vec2 = vec2(96.0, 48.0);

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two colours (WCAG 2.1, relative luminance).
    fn contrast(one: Color32, other: Color32) -> f32 {
        let luminance = |colour: Color32| {
            crate::math::luminance(crate::image::transfer::linear_from_srgb8([colour.r(), colour.g(), colour.b()]))
        };
        let (a, b) = (luminance(one) + 0.05, luminance(other) + 0.05);
        if a > b { a / b } else { b / a }
    }

    #[test]
    fn text_and_signals_stand_out_from_their_ground() {
        for (choice, theme, least) in [
            (ThemeChoice::Dark, Theme::Dark, 4.5),
            (ThemeChoice::Light, Theme::Light, 4.5),
            (ThemeChoice::HighContrast, Theme::Dark, 7.0),
        ] {
            let context = Context::default();
            apply(&context, choice);
            let visuals = context.style_of(theme).visuals.clone();
            let colours = palette(&visuals);
            let ground = visuals.panel_fill;
            for colour in
                [visuals.text_color(), visuals.weak_text_color(), colours.accent, colours.warning, colours.error]
            {
                assert!(contrast(colour, ground) >= least, "{choice:?}: {colour:?} {}", contrast(colour, ground));
            }
            assert!(contrast(colours.on_accent, colours.accent) >= 4.5, "{choice:?}");
        }
    }
}
