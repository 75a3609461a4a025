//! What an audit found, by kind of parameter and by place.

use super::AuditSettings;
use super::readers::{KINDS, PLACES, Parameter};
use crate::math::statistics::quantile;
use crate::render::Parameters;
use serde::{Deserialize, Serialize};

/// Differences below this part of the root mean square of their kind are measured against that.
const LEAST_SHARE: f64 = 1e-3;

/// One parameter's derivative, computed in three ways.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// The parameter.
    pub parameter: Parameter,
    /// Whether it belongs to each of [`PLACES`].
    pub places: [bool; 6],
    /// Central difference in `f64`.
    pub difference: f64,
    /// Reverse mode in `f64`.
    pub precise: f64,
    /// Reverse mode in `f32`, as a fit runs it.
    pub single: f64,
}

/// A group of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroupReport {
    /// Name of the kind or place.
    pub name: String,
    /// Number of parameters.
    pub count: usize,
    /// Root mean square of the differences.
    pub size: f64,
    /// Reverse mode in `f64` against the differences.
    pub precise: Comparison,
    /// Reverse mode in `f32` against the differences.
    pub single: Comparison,
}

/// How derivatives compare with differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Median of the relative errors.
    pub typical: f64,
    /// 99th percentile of the relative errors.
    pub percentile_99: f64,
    /// Largest relative error.
    pub worst: f64,
    /// Cosine between the list of derivatives and the list of differences.
    pub cosine: f64,
}

/// One parameter of the worst.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AuditRow {
    /// Which gradient: `picture` or `disagreement`.
    pub gradient: String,
    /// Its name and place, such as `diffuse R at (12, 40)`.
    pub parameter: String,
    /// Central difference in `f64`.
    pub difference: f64,
    /// Reverse mode in `f64`.
    pub precise: f64,
    /// Reverse mode in `f32`.
    pub single: f64,
    /// Relative error of reverse mode in `f64`.
    pub error: f64,
}

/// What an audit found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AuditReport {
    /// How it was done.
    pub settings: AuditSettings,
    /// Number of views.
    pub views: usize,
    /// Pixels that are evidence.
    pub pixels: usize,
    /// Those of them that show surface and background.
    pub silhouette_pixels: usize,
    /// Number of paths that meet the surface 0, 1, 2, ... times.
    pub paths_by_hits: Vec<usize>,
    /// Reads of each level of the mip chain, counted in (texel, pixel) pairs.
    pub reads_per_level: Vec<usize>,
    /// Parameters that no path reads and whose derivative is not exactly zero: must be none.
    pub unread_with_derivative: usize,
    /// Parameters of the gradient of the picture loss.
    pub parameters: usize,
    /// The gradient of the picture loss, by kind and by place.
    pub gradient: Vec<GroupReport>,
    /// The gradient of the views' disagreement, by kind.
    pub consistency: Vec<GroupReport>,
    /// The worst rows of both, by error in `f64`.
    pub worst: Vec<AuditRow>,
    /// Wall time in seconds.
    pub seconds: f64,
}

impl AuditReport {
    pub(super) fn add_gradient(&mut self, rows: Vec<Difference>, parameters: &Parameters<f32>) {
        self.parameters = rows.len();
        self.gradient = self.groups("picture", &rows, parameters);
    }

    pub(super) fn add_consistency(&mut self, rows: Vec<Difference>, parameters: &Parameters<f32>) {
        self.consistency = self.groups("disagreement", &rows, parameters);
    }

    fn groups(&mut self, gradient: &str, rows: &[Difference], parameters: &Parameters<f32>) -> Vec<GroupReport> {
        let sizes: Vec<f64> = (0..KINDS.len())
            .map(|kind| {
                let own = || rows.iter().filter(|row| row.parameter.kind() == kind);
                (own().map(|row| row.difference * row.difference).sum::<f64>() / own().count().max(1) as f64).sqrt()
            })
            .collect();
        let error = |row: &Difference, derivative: f64| {
            let size = row.difference.abs().max(LEAST_SHARE * sizes[row.parameter.kind()]);
            let error = (derivative - row.difference).abs() / size.max(f64::MIN_POSITIVE);
            // A derivative that is not a number must not pass.
            if error.is_nan() { f64::INFINITY } else { error }
        };
        let mut order: Vec<&Difference> = rows.iter().collect();
        order.sort_by(|a, b| error(b, b.precise).total_cmp(&error(a, a.precise)));
        let (map_width, light_width) = (parameters.texels.levels[0].width, parameters.environment_size.0);
        self.worst.extend(order.iter().take(self.settings.worst_rows).map(|row| AuditRow {
            gradient: gradient.into(),
            parameter: row.parameter.name(map_width, light_width),
            difference: row.difference,
            precise: row.precise,
            single: row.single,
            error: error(row, row.precise),
        }));

        let group = |name: &str, member: &dyn Fn(&Difference) -> bool| {
            let own: Vec<&Difference> = rows.iter().filter(|row| member(row)).collect();
            let compare = |derivative: fn(&Difference) -> f64| {
                let errors: Vec<f64> = own.iter().map(|row| error(row, derivative(row))).collect();
                let (mut cross, mut first, mut second) = (0.0, 0.0, 0.0);
                for row in &own {
                    // Kinds differ in size by orders; each counts in its own.
                    let size = sizes[row.parameter.kind()].max(f64::MIN_POSITIVE);
                    let (a, d) = (derivative(row) / size, row.difference / size);
                    cross += a * d;
                    first += a * a;
                    second += d * d;
                }
                Comparison {
                    typical: quantile(&errors, 0.5),
                    percentile_99: quantile(&errors, 0.99),
                    worst: errors.iter().copied().fold(0.0, f64::max),
                    cosine: cross / (first * second).sqrt(),
                }
            };
            let size = own.iter().map(|row| row.difference * row.difference).sum::<f64>() / own.len().max(1) as f64;
            GroupReport {
                name: name.into(),
                count: own.len(),
                size: size.sqrt(),
                precise: compare(|row| row.precise),
                single: compare(|row| row.single),
            }
        };
        let kinds = KINDS.iter().enumerate().map(|(kind, name)| group(name, &|row| row.parameter.kind() == kind));
        let places = PLACES.iter().enumerate().map(|(place, name)| group(name, &|row| row.places[place]));
        kinds.chain(places).filter(|group| group.count > 0).collect()
    }

    /// Whether reverse mode in `f64` keeps to the limits in every group.
    pub fn passes(&self) -> bool {
        let good = |group: &GroupReport| {
            group.precise.worst < self.settings.largest_error && group.precise.cosine > self.settings.smallest_cosine
        };
        let complete = KINDS.iter().all(|kind| self.gradient.iter().any(|group| group.name == *kind));
        complete && self.unread_with_derivative == 0 && self.gradient.iter().chain(&self.consistency).all(good)
    }

    /// The report as Markdown; the worst rows are listed when it does not pass.
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "# Gradients against central differences\n\n\
             {} parameters, {} views, {} pixels ({} at silhouettes), {} samples a pixel, {:.1} s.\n\
             Paths by number of surface hits, from 0: {:?}. Reads by mip level, from 0: {:?}.\n\
             Parameters that no path reads but that have a derivative: {}.\n\n\
             The error of a derivative a against a difference d is |a - d| / max(|d|, {LEAST_SHARE} g), g the root mean \
             square of the differences of its kind.\n",
            self.parameters,
            self.views,
            self.pixels,
            self.silhouette_pixels,
            self.settings.samples,
            self.seconds,
            self.paths_by_hits,
            self.reads_per_level,
            self.unread_with_derivative,
        );
        for (title, groups) in [
            ("Gradient of the picture loss", &self.gradient),
            ("Gradient of the views' disagreement", &self.consistency),
        ] {
            if groups.is_empty() {
                continue;
            }
            text += &format!(
                "\n## {title}\n\n\
                 | group | count | size | f64 typical | f64 99 % | f64 worst | f64 1 - cosine | f32 typical | f32 99 % | \
                 f32 worst | f32 1 - cosine |\n|---|---|---|---|---|---|---|---|---|---|---|\n"
            );
            for group in groups {
                text += &format!("| {} | {} | {:.1e} ", group.name, group.count, group.size);
                for own in [&group.precise, &group.single] {
                    text += &format!(
                        "| {:.1e} | {:.1e} | {:.1e} | {:.1e} ",
                        own.typical,
                        own.percentile_99,
                        own.worst,
                        1.0 - own.cosine
                    );
                }
                text += "|\n";
            }
        }
        let (largest, smallest) = (self.settings.largest_error, self.settings.smallest_cosine);
        let verdict = if self.passes() { "passes" } else { "FAILS" };
        text +=
            &format!("\nLimits in f64: error below {largest}, cosine above {smallest} in every group: {verdict}.\n");
        if !self.passes() {
            text += "\n| gradient | parameter | difference | f64 | f32 | f64 / difference | error |\n|---|---|---|---|---|---|---|\n";
            for row in &self.worst {
                text += &format!(
                    "| {} | {} | {:.6e} | {:.6e} | {:.6e} | {:.6} | {:.1e} |\n",
                    row.gradient,
                    row.parameter,
                    row.difference,
                    row.precise,
                    row.single,
                    row.precise / row.difference,
                    row.error
                );
            }
        }
        text
    }
}
