//! Numbers and text as the report shows them: rounded, with units, safe inside HTML.

/// About three significant digits; `–` for NaN, powers of ten outside 1e-4 to 1e6.
pub fn short(value: f64) -> String {
    if value.is_nan() {
        return "–".into();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞".into() } else { "−∞".into() };
    }
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let text = if !(1e-4..1e6).contains(&size) {
        // The exponent is what `{:e}` says after rounding, so that 9.999e6 becomes 1e7.
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{}e{exponent}", without_zeros(digits))
    } else {
        let decimals = decimals_for_three_digits(size);
        without_zeros(&format!("{value:.decimals$}")).to_string()
    };
    text.replace('-', "−").replace("e−", "e-")
}

/// Decimals that show three digits of a positive number, counted after rounding: 0.0099999 is 0.0100.
fn decimals_for_three_digits(size: f64) -> usize {
    let rounded = format!("{size:.2e}");
    let exponent: i32 = rounded.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    (2 - exponent).max(0) as usize
}

fn without_zeros(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

/// Three significant digits with their trailing zeros, for columns: `0.00640`.
pub fn significant(value: f64) -> String {
    let size = value.abs();
    if !(1e-4..1e6).contains(&size) {
        return short(value);
    }
    fixed(value, decimals_for_three_digits(size))
}

/// A number with a fixed number of decimals; `–` for NaN, `∞` when infinite.
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}").replace('-', "−") } else { short(value) }
}

/// A duration: `0.42 s`, `12.3 s`, `4 min 05 s`, `2 h 07 min`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return short(seconds);
    }
    if seconds < 59.95 {
        return if seconds < 9.995 { format!("{seconds:.2} s") } else { format!("{seconds:.1} s") };
    }
    let whole = seconds.round() as u64;
    if whole < 3600 {
        format!("{} min {:02} s", whole / 60, whole % 60)
    } else {
        format!("{} h {:02} min", whole / 3600, whole % 3600 / 60)
    }
}

/// A size in memory: `812 MB`, `3.42 GB`; a megabyte is a million bytes.
pub fn memory(bytes: u64) -> String {
    let bytes = bytes as f64;
    if bytes < 999.5e6 { format!("{:.0} MB", bytes / 1e6) } else { format!("{:.2} GB", bytes / 1e9) }
}

/// A share in [0, 1] as a percentage.
pub fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "–".into();
    }
    let value = 100.0 * share;
    if value == 0.0 {
        return "0 %".into();
    }
    let decimals = if value.abs() < 0.995 { 2 } else { 1 };
    format!("{value:.decimals$} %")
}

/// A whole number with thin spaces between groups of three digits.
pub fn whole(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(digit);
    }
    text
}

/// Text that is safe inside HTML and inside quoted attributes.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_sensibly() {
        for (value, text) in [
            (0.0, "0"),
            (0.123456, "0.123"),
            (12.3456, "12.3"),
            (123.456, "123"),
            (123_456.0, "123456"),
            (-1.5, "−1.5"),
            (0.00001234, "1.23e-5"),
            (9.999e6, "1e7"),
            (f64::NAN, "–"),
            (f64::NEG_INFINITY, "−∞"),
        ] {
            assert_eq!(short(value), text);
        }
        assert_eq!(
            [0.421, 12.34, 59.96, 245.0, 7620.0, f64::NAN].map(duration),
            ["0.42 s", "12.3 s", "1 min 00 s", "4 min 05 s", "2 h 07 min", "–"]
        );
        assert_eq!(
            [0.0064, 0.009_999_99, 12.0, 1e-9, f64::NAN].map(significant),
            ["0.00640", "0.0100", "12.0", "1e-9", "–"]
        );
        assert_eq!([812_000_000, 3_420_000_000].map(memory), ["812 MB", "3.42 GB"]);
        assert_eq!([0.0, 0.0012, 0.25, f64::NAN].map(percent), ["0 %", "0.12 %", "25.0 %", "–"]);
        assert_eq!(whole(1_234_567), "1\u{2009}234\u{2009}567");
        assert_eq!(escaped("<a href='x'>&"), "&lt;a href=&#39;x&#39;&gt;&amp;");
    }
}
