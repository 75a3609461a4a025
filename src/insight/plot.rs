//! Small plots as SVG text: lines and bars, linear or logarithmic, for the report and for studies.
//!
//! Colours come from CSS variables, so that one plot suits a light and a dark page; [`standalone`] adds the style for a
//! file of its own. Values that are not finite, or not positive on a logarithmic axis, are left out.

use super::report::number::{escaped, short};

/// How an axis is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences.
    Linear,
    /// Equal ratios.
    Logarithmic,
}

/// A line with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Shown in the legend.
    pub name: String,
    /// (x, y), in the order they are joined.
    pub points: Vec<(f64, f64)>,
    /// Mark each point: for few points that were measured apart.
    pub marked: bool,
}

/// Lines over a common axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlot {
    /// Name and unit along x.
    pub x_label: String,
    /// Name and unit along y.
    pub y_label: String,
    /// Division of x.
    pub x_scale: Scale,
    /// Division of y.
    pub y_scale: Scale,
    /// The lines.
    pub series: Vec<Series>,
    /// Vertical marks: (x, name), such as the start of a stage.
    pub marks: Vec<(f64, String)>,
}

/// One bar with a whisker.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Shown beside the bar.
    pub label: String,
    /// Length of the bar.
    pub value: f64,
    /// Ends of the whisker, such as the quartiles.
    pub range: Option<(f64, f64)>,
}

/// The style of all plots, with `--s0` to `--s5` as the colours of series.
pub const STYLE: &str = include_str!("plot.css");

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 272.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 42.0;
const BOTTOM: f64 = 44.0;
/// Room above bars, for the title.
const BAR_TOP: f64 = 28.0;
/// Longest polyline: more points are thinned to the extremes of each bucket.
const MOST_POINTS: usize = 800;
const COLOURS: usize = 6;

/// The range of an axis and its places on paper.
struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    paper: (f64, f64),
}

impl Axis {
    /// An axis over the values; `None` when nothing can be shown.
    fn over(values: impl Iterator<Item = f64>, scale: Scale, paper: (f64, f64)) -> Option<Axis> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|&value| is_shown(value, scale)) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            return None;
        }
        if scale == Scale::Linear {
            let margin = if high > low { 0.0 } else { high.abs().max(1e-3) * 0.5 };
            (low, high) = (low - margin, high + margin);
        } else {
            (low, high) = (low / 1.1, high * 1.1);
        }
        Some(Axis { scale, low, high, paper })
    }

    fn place(&self, value: f64) -> f64 {
        let fraction = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            // Differences of logarithms: a ratio of far ends would overflow.
            Scale::Logarithmic => (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln()),
        };
        self.paper.0 + fraction * (self.paper.1 - self.paper.0)
    }

    /// Round values inside the range, about five of them.
    fn ticks(&self) -> Vec<f64> {
        let ticks = match self.scale {
            Scale::Linear => linear_ticks(self.low, self.high),
            Scale::Logarithmic => logarithmic_ticks(self.low, self.high),
        };
        // Less than a factor of two: decades do not divide the axis.
        if ticks.len() < 2 { linear_ticks(self.low, self.high) } else { ticks }
    }
}

fn is_shown(value: f64, scale: Scale) -> bool {
    value.is_finite() && value.abs() < 1e300 && (scale == Scale::Linear || value > 1e-300)
}

fn linear_ticks(low: f64, high: f64) -> Vec<f64> {
    let raw = (high - low) / 4.0;
    if !(raw.is_finite() && raw > 0.0) {
        return vec![low];
    }
    let decade = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * decade).find(|&step| step >= raw).unwrap_or(raw);
    let first = (low / step).ceil();
    (0..=12).map(|k| (first + f64::from(k)) * step).take_while(|&t| t <= high + 1e-9 * step).collect()
}

fn logarithmic_ticks(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let every = ((last - first) / 6).max(1);
    let inside = |value: &f64| *value >= low && *value <= high;
    let decades: Vec<f64> = (first..=last).step_by(every as usize).map(|p| 10f64.powi(p)).filter(inside).collect();
    let parted = |parts: &[f64]| -> Vec<f64> {
        (first..=last).flat_map(|p| parts.iter().map(move |m| m * 10f64.powi(p))).filter(inside).collect()
    };
    // The coarsest division that leaves at least three ticks.
    if decades.len() >= 3 {
        return decades;
    }
    let thirds = parted(&[1.0, 2.0, 5.0]);
    if thirds.len() >= 3 { thirds } else { parted(&[1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0]) }
}

impl LinePlot {
    /// The plot as an SVG element without style; `None` when there is nothing to show.
    pub fn svg(&self) -> Option<String> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let shown = |p: &&(f64, f64)| is_shown(p.0, self.x_scale) && is_shown(p.1, self.y_scale);
        let x = Axis::over(points().filter(shown).map(|p| p.0), self.x_scale, (LEFT, WIDTH - RIGHT))?;
        let y = Axis::over(points().filter(shown).map(|p| p.1), self.y_scale, (HEIGHT - BOTTOM, TOP))?;

        let mut svg = opening(WIDTH, HEIGHT, &format!("{} over {}", self.y_label, self.x_label));
        for tick in y.ticks() {
            let at = y.place(tick);
            svg += &format!("<line class=grid x1={LEFT} x2={:.1} y1={at:.1} y2={at:.1} />", WIDTH - RIGHT);
            svg += &format!(
                "<text class=tick text-anchor=end x={:.1} y={:.1}>{}</text>",
                LEFT - 8.0,
                at + 4.0,
                short(tick)
            );
        }
        for tick in x.ticks() {
            let at = x.place(tick);
            let foot = HEIGHT - BOTTOM;
            svg += &format!("<line class=axis x1={at:.1} x2={at:.1} y1={foot} y2={:.1} />", foot + 4.0);
            svg +=
                &format!("<text class=tick text-anchor=middle x={at:.1} y={:.1}>{}</text>", foot + 18.0, short(tick));
        }
        let foot = HEIGHT - BOTTOM;
        svg += &format!("<line class=axis x1={LEFT} x2={:.1} y1={foot} y2={foot} />", WIDTH - RIGHT);
        svg += &format!(
            "<text class=label text-anchor=end x={:.1} y={:.1}>{}</text>",
            WIDTH - RIGHT,
            HEIGHT - 6.0,
            escaped(&self.x_label)
        );
        for (at, name) in self.marks.iter().filter(|(at, _)| is_shown(*at, self.x_scale) && *at > x.low && *at < x.high)
        {
            let at = x.place(*at);
            svg += &format!("<line class=mark x1={at:.1} x2={at:.1} y1={TOP} y2={foot} />");
            svg += &format!("<text class=tick x={:.1} y={:.1}>{}</text>", at + 4.0, TOP - 5.0, escaped(name));
        }
        for (index, series) in self.series.iter().enumerate() {
            svg += &line_of(series, index % COLOURS, &x, &y);
        }
        // The legend doubles as the name of the y axis.
        let mut at = LEFT;
        if self.series.len() == 1 {
            svg += &format!("<text class=label x={LEFT} y=16>{}</text>", escaped(&self.y_label));
        } else {
            for (index, series) in self.series.iter().enumerate() {
                let colour = index % COLOURS;
                svg += &format!("<line class='line s{colour}' x1={at:.1} x2={:.1} y1=12 y2=12 />", at + 16.0);
                svg += &format!("<text class=label x={:.1} y=16>{}</text>", at + 22.0, escaped(&series.name));
                at += 42.0 + 6.6 * series.name.chars().count() as f64;
            }
        }
        svg += "</svg>";
        Some(svg)
    }
}

fn line_of(series: &Series, colour: usize, x: &Axis, y: &Axis) -> String {
    let mut svg = String::new();
    // A gap where a value cannot be shown: joining over it would hide it.
    for run in series.points.split(|p| !(is_shown(p.0, x.scale) && is_shown(p.1, y.scale))) {
        let places: Vec<(f64, f64)> = thinned(run).into_iter().map(|(px, py)| (x.place(px), y.place(py))).collect();
        if places.len() > 1 {
            let list: Vec<String> = places.iter().map(|(px, py)| format!("{px:.1},{py:.1}")).collect();
            svg += &format!("<polyline class='line s{colour}' points='{}' />", list.join(" "));
        }
        if series.marked || places.len() == 1 {
            for (px, py) in places {
                svg += &format!("<circle class='dot s{colour}' cx={px:.1} cy={py:.1} r=3 />");
            }
        }
    }
    svg
}

/// At most [`MOST_POINTS`] points: the lowest and the highest of each bucket, in their order.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(MOST_POINTS + 2);
    for bucket in points.chunks(points.len().div_ceil(MOST_POINTS / 2)) {
        let by_height = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
        let low = bucket.iter().enumerate().min_by(by_height).map_or(0, |(index, _)| index);
        let high = bucket.iter().enumerate().max_by(by_height).map_or(0, |(index, _)| index);
        kept.push(bucket[low.min(high)]);
        if low != high {
            kept.push(bucket[low.max(high)]);
        }
    }
    kept
}

/// Horizontal bars with whiskers as an SVG element without style; `None` when no bar has a finite value.
pub fn bar_svg(title: &str, bars: &[Bar]) -> Option<String> {
    let ends = bars.iter().flat_map(|bar| {
        let (low, high) = bar.range.unwrap_or((bar.value, bar.value));
        [bar.value, low, high]
    });
    bars.iter().find(|bar| bar.value.is_finite())?;
    let longest = bars.iter().map(|bar| bar.label.chars().count()).max().unwrap_or(0).min(34);
    let left = 16.0 + 6.6 * longest as f64;
    // Room at the right for the value.
    let axis = Axis::over(ends.chain([0.0]), Scale::Linear, (left, WIDTH - 84.0))?;
    let height = BAR_TOP + 24.0 * bars.len() as f64 + 8.0;
    let mut svg = opening(WIDTH, height, title);
    svg += &format!("<text class=label x=8 y=16>{}</text>", escaped(title));
    let zero = axis.place(0.0);
    for (index, bar) in bars.iter().enumerate() {
        let middle = BAR_TOP + 24.0 * index as f64 + 12.0;
        let label: String = bar.label.chars().take(34).collect();
        svg += &format!(
            "<text class=tick text-anchor=end x={:.1} y={:.1}>{}</text>",
            left - 8.0,
            middle + 4.0,
            escaped(&label)
        );
        let mut end = zero;
        if is_shown(bar.value, Scale::Linear) {
            let at = axis.place(bar.value);
            let (from, to) = (zero.min(at), zero.max(at));
            svg += &format!(
                "<rect class=bar x={from:.1} y={:.1} width={:.1} height=14 />",
                middle - 7.0,
                (to - from).max(1.0)
            );
            end = end.max(to);
        }
        if let Some((low, high)) = bar.range.filter(|(low, high)| low.is_finite() && high.is_finite() && high > low) {
            let (from, to) = (axis.place(low), axis.place(high));
            svg += &format!("<line class=whisker x1={from:.1} x2={to:.1} y1={middle:.1} y2={middle:.1} />");
            end = end.max(to);
        }
        svg += &format!("<text class=tick x={:.1} y={:.1}>{}</text>", end + 7.0, middle + 4.0, short(bar.value));
    }
    svg += &format!("<line class=axis x1={zero:.1} x2={zero:.1} y1={BAR_TOP} y2={:.1} />", height - 8.0);
    svg += "</svg>";
    Some(svg)
}

fn opening(width: f64, height: f64, name: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' class=plot viewBox='0 0 {width} {height}' role=img aria-label='{}'>",
        escaped(name)
    )
}

/// Makes an SVG file of elements of this module, one below the other. Attributes are quoted, as XML wants it.
pub fn standalone(plots: &[String]) -> String {
    let mut body = String::new();
    let mut top = 0.0;
    for plot in plots {
        let height: f64 = plot
            .split("viewBox='0 0 ")
            .nth(1)
            .and_then(|rest| rest.split(['\'', ' ']).nth(1))
            .and_then(|height| height.parse().ok())
            .unwrap_or(HEIGHT);
        body += &plot.replacen("<svg ", &format!("<svg y={top} width={WIDTH} height={height} "), 1);
        top += height + 16.0;
    }
    let body = quoted_attributes(&body);
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {top}' width='{WIDTH}' height='{top}'>\
         <style>{STYLE}</style><rect class='paper' width='100%' height='100%' />{body}</svg>\n"
    )
}

/// Puts quotes around the bare attributes that HTML allows and XML does not.
fn quoted_attributes(html: &str) -> String {
    let mut out = String::with_capacity(html.len() + html.len() / 4);
    let mut characters = html.chars().peekable();
    let (mut in_tag, mut in_quote) = (false, false);
    while let Some(character) = characters.next() {
        out.push(character);
        match character {
            '<' if !in_quote => in_tag = true,
            '>' if !in_quote => in_tag = false,
            '\'' if in_tag => in_quote = !in_quote,
            '=' if in_tag && !in_quote && characters.peek() != Some(&'\'') => {
                out.push('\'');
                while let Some(next) = characters.next_if(|c| !c.is_whitespace() && *c != '>') {
                    out.push(next);
                }
                out.push('\'');
            }
            _ => {}
        }
    }
    out
}

#[cfg(test)]
mod tests;
