//! What a contest says: tables of medians and quartiles over seeds, every value as CSV, and curves of error over seconds.

use super::contestant::Contestant;
use super::judge::{COLUMNS, COMPARED, IMAGE, Judge};
use super::options::ContestOptions;
use super::reach::time_to_reach;
use super::snapshot::Snapshot;
use crate::error::Result;
use crate::fit::FitSettings;
use crate::insight::plot::{LinePlot, Scale, Series, standalone};
use crate::insight::report::number::short;
use crate::lab::study_table::StudyTable;
use crate::math::statistics::quantile;
use std::path::Path;

/// Columns of the short table, by their place in [`COLUMNS`].
const SHOWN: [usize; 10] = [0, 2, 5, 6, 8, 11, 14, 15, 16, 17];

/// A judged snapshot.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Whose it is.
    pub method: Contestant,
    /// Seed of the fit.
    pub seed: u64,
    /// Its figures.
    pub snapshot: Snapshot,
    /// Its scores, one a column of [`COLUMNS`].
    pub scores: Vec<f64>,
}

impl Entry {
    /// `adam, 10 s` or `adam, end`.
    fn row(&self) -> String {
        match self.snapshot.due {
            Some(due) => format!("{}, {} s", self.method.name(), short(due)),
            None => format!("{}, end", self.method.name()),
        }
    }
}

/// What is known of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneResults {
    /// Name of the scene, unique in the contest.
    pub name: String,
    /// What was run, in a sentence.
    pub described: String,
    /// Scores of the truth itself: what the noise of photos and judge leaves.
    pub truth: Vec<f64>,
    /// Scores of what every method begins from.
    pub start: Vec<f64>,
    /// The snapshots, in the order they were judged.
    pub entries: Vec<Entry>,
}

impl SceneResults {
    /// Nothing yet of a scene.
    pub fn new(name: String, judge: &Judge, base: &FitSettings) -> Self {
        let scene = judge.scene();
        let held_out = scene.views.iter().filter(|view| view.held_out).count();
        let size = scene.views.first().map_or((0, 0), |view| (view.camera.width, view.camera.height));
        let [training, judged_held_out, relit] = judge.pictures();
        let described = format!(
            "{} views of {} x {} pixels to fit, {held_out} held out; {} triangles; maps of {} x {}, light of {} x {}, {} \
             surface hits. Judged on {training} training, {judged_held_out} held-out and {relit} relit pictures, over all \
             their pixels.",
            scene.views.len() - held_out,
            size.0,
            size.1,
            scene.mesh.triangles.len(),
            base.map_size,
            base.map_size,
            2 * base.environment_height,
            base.environment_height,
            base.bounces,
        );
        SceneResults { name, described, truth: Vec::new(), start: Vec::new(), entries: Vec::new() }
    }

    /// Adds a judged snapshot.
    pub fn add(&mut self, method: Contestant, seed: u64, snapshot: Snapshot, scores: Vec<f64>) {
        self.entries.push(Entry { method, seed, snapshot, scores });
    }

    /// The methods that have a snapshot, in the order they were run.
    fn methods(&self) -> Vec<Contestant> {
        let mut methods = Vec::new();
        for entry in &self.entries {
            if !methods.contains(&entry.method) {
                methods.push(entry.method);
            }
        }
        methods
    }

    fn seeds(&self) -> Vec<u64> {
        let mut seeds: Vec<u64> = self.entries.iter().map(|entry| entry.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    }

    fn of(&self, method: Contestant, seed: u64) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.method == method && entry.seed == seed)
    }

    /// Errors over seconds: one row a method and time. Columns of scores that nothing has are left out.
    pub fn table(&self, columns: &[usize]) -> StudyTable {
        let all = || [&self.truth, &self.start].into_iter().chain(self.entries.iter().map(|entry| &entry.scores));
        let known = |column: &usize| all().any(|scores| scores.get(*column).is_some_and(|value| value.is_finite()));
        let columns: Vec<usize> = columns.iter().copied().filter(known).collect();
        let mut headings = vec![("seconds", ""), ("processor seconds", "")];
        headings.extend(columns.iter().map(|&column| COLUMNS[column]));
        headings.extend([("peak memory", "MiB"), ("steps", "")]);
        let mut table = StudyTable::new(&format!("{}: error over seconds", self.name), "method, time", &headings);
        let mut add = |row: &str, seconds: f64, processor: f64, scores: &[f64], memory: f64, steps: f64| {
            let mut values = vec![seconds, processor];
            values.extend(columns.iter().map(|&column| scores.get(column).copied().unwrap_or(f64::NAN)));
            values.extend([memory, steps]);
            table.add(row, &values);
        };
        add("the truth itself", 0.0, 0.0, &self.truth, 0.0, 0.0);
        add("start of all", 0.0, 0.0, &self.start, 0.0, 0.0);
        for method in self.methods() {
            for entry in self.entries.iter().filter(|entry| entry.method == method) {
                let own = &entry.snapshot;
                let memory = own.peak_bytes.map_or(f64::NAN, |bytes| bytes as f64 / f64::from(1 << 20));
                let processor = own.cpu_seconds.unwrap_or(f64::NAN);
                add(&entry.row(), own.seconds, processor, &entry.scores, memory, own.step as f64);
            }
        }
        table.notes.push(self.described.clone());
        table
    }

    /// When each method reaches the image error that the reference ends with, and how its last errors compare. The
    /// reference is Mitsuba where it ran, else the first method. `None` without an entry.
    pub fn reach(&self) -> Option<StudyTable> {
        let methods = self.methods();
        let reference =
            methods.iter().copied().find(|&method| method == Contestant::Mitsuba).or(methods.first().copied())?;
        let mut headings = vec![
            ("time to reach".to_string(), "s"),
            ("share of its time".to_string(), ""),
            ("share of its processor time".to_string(), ""),
        ];
        headings.extend(COMPARED.map(|column| (format!("{} at the end, ratio", COLUMNS[column].0), "")));
        let headings: Vec<(&str, &str)> = headings.iter().map(|(name, unit)| (name.as_str(), *unit)).collect();
        let title = format!("{}: time to reach the image error that {} ends with", self.name, reference.name());
        let mut table = StudyTable::new(&title, "method", &headings);
        for method in methods {
            for seed in self.seeds() {
                let (Some(theirs), Some(ours)) = (self.of(reference, seed).last(), self.of(method, seed).last()) else {
                    continue;
                };
                let level = theirs.scores[IMAGE];
                let seconds = |entry: &Entry| entry.snapshot.seconds;
                let processor = |entry: &Entry| entry.snapshot.cpu_seconds.unwrap_or(f64::NAN);
                let reached = |time: &dyn Fn(&Entry) -> f64| {
                    let curve: Vec<_> = self.of(method, seed).map(|entry| (time(entry), entry.scores[IMAGE])).collect();
                    time_to_reach(&curve, level).unwrap_or(f64::NAN)
                };
                let time = reached(&seconds);
                let mut values = vec![time, time / seconds(theirs), reached(&processor) / processor(theirs)];
                values.extend(COMPARED.map(|column| ours.scores[column] / theirs.scores[column]));
                table.add(method.name(), &values);
            }
        }
        table.notes.push(
            "Between two snapshots time is read off a straight line of logarithms; a method that is there at its first \
             snapshot has that one's time, which is an upper bound; `failed` says that it never came there."
                .into(),
        );
        Some(table)
    }

    /// Curves over wall-clock seconds, medians over seeds: one plot a compared score.
    pub fn plots(&self) -> Vec<String> {
        let methods = self.methods();
        let plot = |column: usize| {
            let series = methods.iter().map(|&method| {
                let mut rows: Vec<String> = Vec::new();
                for entry in self.entries.iter().filter(|entry| entry.method == method) {
                    if !rows.contains(&entry.row()) {
                        rows.push(entry.row());
                    }
                }
                let median = |row: &String, value: &dyn Fn(&Entry) -> f64| {
                    let own = self.entries.iter().filter(|entry| entry.method == method && entry.row() == *row);
                    quantile(&own.map(value).collect::<Vec<_>>(), 0.5)
                };
                let point = |row: &String| {
                    (median(row, &|entry| entry.snapshot.seconds), median(row, &|entry| entry.scores[column]))
                };
                let mut points: Vec<(f64, f64)> = rows.iter().map(point).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series { name: format!("{} {}", COLUMNS[column].0, method.name()), points, marked: true }
            });
            let plot = LinePlot {
                x_label: "wall-clock seconds from the start of the process".into(),
                y_label: COLUMNS[column].0.into(),
                x_scale: Scale::Logarithmic,
                y_scale: Scale::Logarithmic,
                series: series.collect(),
                marks: Vec::new(),
            };
            plot.svg()
        };
        COMPARED.into_iter().filter_map(plot).collect()
    }
}

/// All scenes, and what went wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Contest {
    /// What was run and how, in sentences.
    pub described: Vec<String>,
    /// What could not be run, and why.
    pub notes: Vec<String>,
    /// The scenes.
    pub scenes: Vec<SceneResults>,
}

impl Contest {
    /// Nothing yet.
    pub fn new(options: &ContestOptions) -> Self {
        let threads = options.threads.map_or("all processors".to_string(), |threads| format!("{threads} threads"));
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = load.split_whitespace().next().unwrap_or("unknown");
        Contest {
            described: vec![
                format!(
                    "Each fit may take {} s on {threads} ({} processors, load {load} when it began); seeds 1 to {}.",
                    short(options.seconds),
                    std::thread::available_parallelism().map_or(0, usize::from),
                    options.seeds
                ),
                "Seconds count from the start of the process, reading, building and compiling included; writing snapshots \
                 and judging them are left out. All methods have the same start values, views, sizes and length of paths. \
                 Pictures are judged by one path tracer, with the noise of its paths taken off the squared error."
                    .into(),
            ],
            notes: Vec::new(),
            scenes: Vec::new(),
        }
    }

    /// A name that no scene has yet.
    pub fn unused_name(&self, name: &str) -> String {
        let plain: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        let taken = |name: &str| self.scenes.iter().any(|scene| scene.name == name);
        if !taken(&plain) {
            return plain;
        }
        let numbered = (2..).map(|number| format!("{plain}-{number}"));
        numbered.into_iter().find(|name| !taken(name)).unwrap_or(plain)
    }

    /// The whole as one Markdown text.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("# Error against seconds\n");
        for sentence in self.described.iter().chain(&self.notes) {
            text += &format!("\n{sentence}\n");
        }
        for scene in &self.scenes {
            for table in scene.reach().into_iter().chain([scene.table(&SHOWN)]) {
                text += &format!("\n{}", table.to_markdown());
            }
        }
        text
    }

    /// One line a snapshot, every score with all digits.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("scene,method,seed,due,seconds,processor_seconds,step,peak_bytes");
        for (name, _) in COLUMNS {
            text += &format!(",{}", name.replace([' ', '-'], "_").replace('.', ""));
        }
        text.push('\n');
        let numbers = |scores: &[f64]| scores.iter().map(|score| format!(",{score}")).collect::<String>();
        for scene in &self.scenes {
            for (name, scores) in [("truth", &scene.truth), ("start", &scene.start)] {
                text += &format!("{},{name},,,0,0,0,{}\n", scene.name, numbers(scores));
            }
            for entry in &scene.entries {
                let own = &entry.snapshot;
                let due = own.due.map_or("end".to_string(), |due| due.to_string());
                let processor = own.cpu_seconds.map_or(String::new(), |seconds| seconds.to_string());
                let memory = own.peak_bytes.map_or(String::new(), |bytes| bytes.to_string());
                let method = entry.method.name();
                text += &format!(
                    "{},{method},{},{due},{},{processor},{},{memory}{}\n",
                    scene.name,
                    entry.seed,
                    own.seconds,
                    own.step,
                    numbers(&entry.scores)
                );
            }
        }
        text
    }

    /// Writes `contest.md`, `contest.csv`, and for each scene `contest-SCENE.svg` and `contest-SCENE.csv`, which has
    /// medians and quartiles of every score.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let write = |name: String, text: &str| crate::files::write_bytes(&folder.join(name), text.as_bytes());
        write("contest.md".into(), &self.to_markdown())?;
        write("contest.csv".into(), &self.to_csv())?;
        for scene in &self.scenes {
            let every: Vec<usize> = (0..COLUMNS.len()).collect();
            write(format!("contest-{}.csv", scene.name), &scene.table(&every).to_csv())?;
            let plots = scene.plots();
            if !plots.is_empty() {
                write(format!("contest-{}.svg", scene.name), &standalone(&plots))?;
            }
        }
        Ok(())
    }
}
