//! The figures of the views as a table.

use super::ViewCapture;

/// Name of the table in a run folder.
pub const FILE: &str = crate::export::run_folder::CAPTURE_FILE;

/// One line a view, with all digits; what could not be measured is empty. Names are quoted.
pub fn to_csv(views: &[ViewCapture]) -> String {
    let mut text = String::from(
        "view,shift_x_pixels,shift_y_pixels,shift_error_pixels,roll_degrees,roll_error_degrees,roll_corner_pixels,\
         shift_explains,gain,gain_error,doubtful_mask_share,unlike_share\n",
    );
    for own in views {
        let figures = [
            own.shift_x_pixels,
            own.shift_y_pixels,
            own.shift_error_pixels,
            own.roll_degrees,
            own.roll_error_degrees,
            own.roll_corner_pixels,
            own.shift_explains,
            own.gain,
            own.gain_error,
            own.doubtful_mask_share,
            own.unlike_share,
        ];
        let cells = figures.map(|value| if value.is_finite() { value.to_string() } else { String::new() });
        text += &format!("\"{}\",{}\n", own.name.replace('"', "\"\""), cells.join(","));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_empty() {
        let view = ViewCapture {
            name: "a \"b\"".into(),
            shift_x_pixels: 0.5,
            shift_y_pixels: f64::NAN,
            shift_error_pixels: 0.1,
            roll_degrees: 0.0,
            roll_error_degrees: 0.0,
            roll_corner_pixels: 0.0,
            shift_explains: 0.75,
            gain: 1.25,
            gain_error: 0.0,
            doubtful_mask_share: f64::NAN,
            unlike_share: 0.0,
        };
        let text = to_csv(&[view]);
        assert_eq!(text.lines().nth(1), Some("\"a \"\"b\"\"\",0.5,,0.1,0,0,0,0.75,1.25,0,,0"));
        assert_eq!(text.lines().next().map(|line| line.split(',').count()), Some(12));
    }
}
