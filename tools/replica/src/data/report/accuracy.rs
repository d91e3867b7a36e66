//! How accurate the places of the points are: absolutely, from the standard deviations that the run states, and
//! relatively, from the agreement of the path with the fixes.
//!
//! The verdict is about consistency: without a better measurement, a path that is wrong as a whole raises no doubt. So the
//! page starts with the accuracy.

use super::finished_run::FinishedRun;
use super::place::Place;
use page::Level;
use serde::Serialize;
use surveying::accuracy::percentile;

/// From the root of the summed variances of both horizontal axes to the radius with 95 % of the positions, for equal
/// axes (FGDC-STD-007.3-1998, NSSDA: 1.7308 RMSE).
const CE95: f64 = 1.7308;
/// From a standard deviation to the interval with 95 % of a normal distribution (NSSDA: 1.9600 RMSE).
const LE95: f64 = 1.96;

/// Uses of positions, with the largest error (95 %) of each, m. The last of the green ones is the goal of the project
/// for its own receivers.
const USES: [Use; 5] = [
    Use { max_m: 0.05, name: "engineering survey" },
    Use { max_m: 0.15, name: "inventory of road assets" },
    Use { max_m: 0.5, name: "maps of lanes" },
    Use { max_m: 2.0, name: "inventory of streets" },
    Use { max_m: 10.0, name: "overview maps and navigation" },
];
/// Uses for less accurate positions.
const LOCAL_USE: &str = "shapes and distances, not positions on the earth";
/// The largest error (95 %) of a green line, m.
const MAX_GREEN_M: f64 = 0.5;
/// The share of the errors that is stated.
const SHARE: f64 = 0.95;
/// Fewer fixes give no 95 % of their differences.
const MIN_FIXES: usize = 20;

struct Use {
    max_m: f64,
    name: &'static str,
}

/// The accuracy of a run.
#[derive(Debug, Serialize)]
pub struct Accuracy {
    /// `None`: the run has no place on the earth.
    pub absolute: Option<Absolute>,
    /// `None`: fewer than 20 fixes can be compared with the path.
    pub relative: Option<Relative>,
}

/// Accuracy of positions on the earth: 95 % of the errors are smaller, at the least accurate submap.
#[derive(Debug, Serialize)]
pub struct Absolute {
    /// Radius of the horizontal errors, m.
    pub ce95_m: f64,
    /// Error of the height, m.
    pub le95_m: f64,
    /// Error of the heading, degrees.
    pub heading95_deg: f64,
    /// What positions of this accuracy are used for.
    pub r#use: &'static str,
}

/// Accuracy of positions relative to each other: 95 % of the fixes are closer to the path, after their mean difference is
/// subtracted. Includes the noise of the fixes.
#[derive(Debug, Serialize)]
pub struct Relative {
    /// Horizontal distance, m.
    pub horizontal95_m: f64,
    /// Distance in height, m; `None` without heights of fixes.
    pub up95_m: Option<f64>,
    /// Number of compared fixes.
    pub n_fixes: usize,
}

/// A line of the page.
pub struct AccuracyLine {
    pub level: Level,
    pub text: String,
}

impl Accuracy {
    /// The accuracy of a run. `place`: its path and fixes.
    pub fn from_run(run: &FinishedRun, place: Option<&Place>) -> Self {
        let deviations = run.georeference.as_ref().and_then(|found| found.standard_deviations.as_ref());
        let absolute = deviations.filter(|_| run.has_north()).map(|deviations| {
            let largest = [&deviations.position_m, &deviations.height_m, &deviations.heading_deg].map(|of| of.largest);
            Absolute::from_deviations(largest)
        });
        let relative =
            place.and_then(|place| Relative::from_differences(&place.differences(), &place.height_differences()));
        Self { absolute, relative }
    }

    /// The accuracy in a sentence.
    pub fn in_words(&self) -> String {
        match &self.absolute {
            None => format!("positions on the earth are unknown; fit for {LOCAL_USE}"),
            Some(Absolute { ce95_m, le95_m, r#use, .. }) => format!(
                "positions are within {} horizontally and {} in height (95 %, as the run states it); fit for {usage}",
                length(*ce95_m),
                length(*le95_m),
                usage = r#use
            ),
        }
    }

    /// The lines of the page: absolute, then relative accuracy.
    pub fn lines(&self) -> [AccuracyLine; 2] {
        let absolute = self.absolute.as_ref().map_or_else(
            || AccuracyLine {
                level: Level::Amber,
                text: format!("Absolute accuracy: unknown, no fixes place the run on the earth. Fit for {LOCAL_USE}."),
            },
            Absolute::line,
        );
        let relative = self.relative.as_ref().map_or_else(
            || AccuracyLine {
                level: Level::Amber,
                text: format!(
                    "Relative accuracy: unknown, fewer than {MIN_FIXES} fixes can be compared with the path."
                ),
            },
            Relative::line,
        );
        [absolute, relative]
    }
}

/// A length as people say it: cm below 1 m.
fn length(metres: f64) -> String {
    if metres < 1.0 { format!("{:.0} cm", (100.0 * metres).max(1.0)) } else { format!("{metres:.1} m") }
}

impl Absolute {
    /// From standard deviations: horizontally (both axes), m; height, m; heading, degrees.
    fn from_deviations([position_m, height_m, heading_deg]: [f64; 3]) -> Self {
        let ce95_m = CE95 * position_m;
        let le95_m = LE95 * height_m;
        let fitting = USES.iter().find(|usage| ce95_m.max(le95_m) <= usage.max_m);
        let r#use = fitting.map_or(LOCAL_USE, |usage| usage.name);
        Self { ce95_m, le95_m, heading95_deg: LE95 * heading_deg, r#use }
    }

    fn line(&self) -> AccuracyLine {
        let Self { ce95_m, le95_m, heading95_deg, r#use } = self;
        AccuracyLine {
            level: level(ce95_m.max(*le95_m)),
            text: format!(
                "Absolute accuracy as the run states it: 95 % within {ce95_m:.2} m horizontally (CE95), {le95_m:.2} m in height \
                 (LE95) and {heading95_deg:.2} degrees in heading. Fit for {use}. Check points measure it."
            ),
        }
    }
}

impl Relative {
    fn from_differences(horizontal: &[[f64; 2]], up: &[f64]) -> Option<Self> {
        if horizontal.len() < MIN_FIXES {
            return None;
        }
        let mean = |axis: usize| horizontal.iter().map(|d| d[axis]).sum::<f64>() / horizontal.len() as f64;
        let [east, north] = [mean(0), mean(1)];
        let mean_up = up.iter().sum::<f64>() / up.len() as f64;
        let up: Vec<f64> = up.iter().map(|d| (d - mean_up).abs()).collect();
        Some(Self {
            horizontal95_m: percentile(horizontal.iter().map(|[e, n]| (e - east).hypot(n - north)).collect(), SHARE)?,
            up95_m: if up.len() < MIN_FIXES { None } else { percentile(up, SHARE) },
            n_fixes: horizontal.len(),
        })
    }

    fn line(&self) -> AccuracyLine {
        let Self { horizontal95_m, up95_m, n_fixes } = self;
        let up = up95_m.map_or_else(String::new, |up| format!(", {up:.2} m in height"));
        AccuracyLine {
            level: level(horizontal95_m.max(up95_m.unwrap_or_default())),
            text: format!(
                "Relative accuracy: 95 % of {n_fixes} fixes are within {horizontal95_m:.2} m of the path horizontally{up}, after \
                 their mean difference is subtracted. The noise of the fixes is included."
            ),
        }
    }
}

fn level(error_m: f64) -> Level {
    if error_m <= MAX_GREEN_M { Level::Green } else { Level::Amber }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stated_deviations_become_95_percent_and_a_use() {
        let absolute = Absolute::from_deviations([3.3215, 4.1514, 0.7792]);
        assert_eq!((absolute.ce95_m * 100.0).round(), 575.0);
        assert_eq!((absolute.le95_m * 100.0).round(), 814.0);
        assert_eq!((absolute.heading95_deg * 100.0).round(), 153.0);
        assert_eq!(absolute.r#use, "overview maps and navigation");
        assert_eq!(absolute.line().level, Level::Amber);
        for (deviation_m, expected, level) in [
            (0.02, "engineering survey", Level::Green),
            (0.05, "inventory of road assets", Level::Green),
            (0.25, "maps of lanes", Level::Green),
            (1.0, "inventory of streets", Level::Amber),
            (12.0, LOCAL_USE, Level::Amber),
        ] {
            let absolute = Absolute::from_deviations([deviation_m, deviation_m, 0.1]);
            assert_eq!((absolute.r#use, absolute.line().level), (expected, level), "{deviation_m}");
        }
    }

    #[test]
    fn common_difference_of_the_fixes_is_no_relative_error() {
        let around = |k: usize| if k.is_multiple_of(2) { 0.1 } else { -0.1 };
        let horizontal: Vec<[f64; 2]> = (0..40).map(|k| [12.0 + around(k), -3.0]).collect();
        let relative = Relative::from_differences(&horizontal, &[7.0; 40]).expect("enough fixes");
        assert!((relative.horizontal95_m - 0.1).abs() < 1e-9 && relative.up95_m == Some(0.0));
        assert_eq!(relative.line().level, Level::Green);
        assert!(Relative::from_differences(&horizontal[..19], &[]).is_none());
        let unknown = Accuracy { absolute: None, relative: None };
        assert!(unknown.lines().iter().all(|line| line.level == Level::Amber && line.text.contains("unknown")));
    }
}
