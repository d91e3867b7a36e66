//! All scores as Markdown, CSV, JSON and a chart.

mod json;
mod tables;

use super::source::{Group, Source, groups};
use super::tally::Tally;
use super::{semantic_kitti, seven};
use chart::{Axis, COLORS, Chart, Series};
use messages::ClassId;
use scores::ScoreTable;
use std::fmt::Write;

/// The scores of all sources.
pub struct ClassReport {
    sources: Vec<Source>,
    groups: Vec<Group>,
    all: Tally,
    /// Word of `--intensity`.
    intensity: String,
    /// Whether the figures of real sweeps can be compared with published ones.
    comparability: Option<String>,
}

impl ClassReport {
    /// Report of at least one source.
    pub fn new(sources: Vec<Source>, intensity: &str) -> Self {
        let comparability = semantic_kitti::comparability(&sources);
        let all = Tally::sum(sources.iter().map(|source| &source.tally));
        Self { groups: groups(&sources), all, intensity: intensity.to_owned(), comparability, sources }
    }

    fn table(&self) -> ScoreTable {
        let names = ClassId::ALL.iter().map(|class| class.name().to_owned()).collect();
        let clouds = self.sources.iter().map(|source| (source.name.clone(), source.tally.classes.clone())).collect();
        ScoreTable { names, clouds }
    }

    /// Scores of the classes: one line for each class of each source.
    pub fn csv(&self) -> String {
        self.table().csv()
    }

    /// Tables.
    pub fn markdown(&self) -> String {
        let mut text = self.table().markdown();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "## Data\n\n{}", tables::data(&self.sources, &self.groups, &self.intensity));
        if let Some(comparability) = &self.comparability {
            let _ = writeln!(text, "SemanticKITTI: {comparability}.\n");
        }
        if let Some(without) = tables::without_intensities(&self.sources) {
            let _ = writeln!(text, "{without}\n");
        }
        if self.all.n_unknown > 0 {
            let _ = writeln!(text, "{}\n", tables::unknown(&self.all));
        }
        if self.all.seven.n() > 0 {
            let names = seven::NAMES.map(str::to_owned).to_vec();
            let table = ScoreTable { names, clouds: vec![("all data".to_owned(), self.all.seven.clone())] };
            let absent = tables::absent_of_seven(&self.all.seven);
            let _ = write!(text, "## Seven classes of LiDOG\n\n{}{absent}", table.markdown());
        }
        if self.all.ranges.iter().any(|range| range.classes.n() > 0) {
            let _ = writeln!(text, "## Ranges\n\n{}", tables::ranges(&self.all));
        }
        if let Some(error) = self.all.calibration_error() {
            let percent = 100.0 * error;
            let calibration = &self.all.reliability;
            let _ = writeln!(text, "## Calibration\n\nExpected calibration error: {percent:.1} %\n\n{calibration}");
            let _ = writeln!(text, "## Coverage and accuracy\n\n{}", tables::coverage(&self.all.coverage));
        }
        let _ = write!(text, "## Confusion\n\n{}", tables::confusion(&self.all.classes));
        text
    }

    /// All numbers, unrounded: a list of the sources, followed by their total if there are several.
    pub fn json(&self) -> serde_json::Value {
        let mut clouds = self.table().json();
        let comparability = |source: &Source| (source.origin == super::source::Origin::SemanticKitti).then_some(());
        for (index, cloud) in clouds.as_array_mut().into_iter().flatten().enumerate() {
            let source = self.sources.get(index);
            json::extend(cloud, source.map_or(&self.all, |source| &source.tally));
            if let Some(source) = source {
                let note = comparability(source).and(self.comparability.as_deref());
                json::extend_source(cloud, source, note);
            }
        }
        clouds
    }

    /// Accuracy over the share of points kept, a line for each group; `None` without scores.
    pub fn chart(&self) -> Option<String> {
        let groups = self.groups.iter().filter(|group| !group.tally.coverage.is_empty());
        let line = |(number, group): (usize, &Group)| {
            let points =
                group.tally.coverage.curve().into_iter().map(|[share, accuracy]| [100.0 * share, 100.0 * accuracy]);
            Series::line(group.name.clone(), COLORS[number % COLORS.len()], points.collect())
        };
        let series: Vec<Series> = groups.enumerate().map(line).collect();
        let lowest = series.iter().flat_map(Series::points).map(|[_, accuracy]| *accuracy).fold(100.0, f64::min);
        let axes =
            [Axis::new("points kept, %", [0.0, 100.0]), Axis::new("correct, %", [(lowest - 1.0).max(0.0), 100.0])];
        let [x, y] = axes;
        (!series.is_empty()).then(|| Chart::new("Accuracy of the points with the highest scores", x, y, series).svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::classes::source::Origin;
    use crate::evaluate::classes::tally::TrueClass;
    use messages::ClassRow;

    fn tally(points: &[(ClassId, ClassId, u8, f32)]) -> Tally {
        let mut tally = Tally::new();
        for &(truth, class, score, range_m) in points {
            tally.add(TrueClass::from_id(truth as u8), ClassRow { class_id: class as u8, score }, range_m);
        }
        tally
    }

    fn source(name: &str, origin: Origin, n_sweeps: usize, tally: Tally) -> Source {
        Source { name: name.to_owned(), origin, n_sweeps, has_intensities: false, tally, other_uses: Vec::new() }
    }

    fn report() -> ClassReport {
        use ClassId::{Road, Sidewalk, Terrain, Unlabeled};
        let right = tally(&[(Road, Road, 255, 5.0); 3]);
        let half = tally(&[(Terrain, Terrain, 255, 15.0), (Terrain, Sidewalk, 51, 50.0)]);
        let off = tally(&[(Road, Unlabeled, 0, 5.0); 2]);
        let real = source("08", Origin::SemanticKitti, 2, tally(&[(Road, Road, 255, 5.0); 2]));
        ClassReport::new(
            vec![
                source("rig-urban-1", Origin::Simulated("rig".to_owned()), 4, right),
                source("kitti-urban-1", Origin::Simulated("kitti".to_owned()), 4, half),
                Source { other_uses: vec![("off", off)], ..real },
            ],
            "auto",
        )
    }

    #[test]
    fn each_sensor_and_real_sweeps_have_a_line() {
        let text = report().markdown();
        for line in [
            "| rig-urban-1 | 4 | 3 | 100.0 % | 100.0 % | 100.0 % | 0.0 % |",
            "| 08, intensity auto | 2 | 2 | 100.0 % | 100.0 % | 100.0 % | 0.0 % |",
            "| 08, intensity off | 2 | 2 | 0.0 % | 0.0 % | 0.0 % | 0.0 % |",
            "| **simulated, kitti** | 4 | 2 | 50.0 % | 50.0 % | 50.0 % | 10.0 % |",
            "| **SemanticKITTI** | 2 | 2 | 100.0 % | 100.0 % | 100.0 % | 0.0 % |",
            "| **all** | 10 | 7 | 75.0 % | 75.0 % | 85.7 % | 2.9 % |",
            "SemanticKITTI: 2 sweeps: not comparable with published benchmarks.",
            "Without intensities: sweeps of 08.",
            "Mean over 2 of the seven classes. Without labeled points: vehicle, person, sidewalk, manmade, vegetation.",
            "| beyond 40 m | 1 | 0.0 % | 0.0 % | 0.0 % |",
            "| 0.30 | 85.7 % | 100.0 % |",
            "| terrain | 2 | . | 50.0 | 50.0 |",
        ] {
            assert!(text.contains(line), "{line}\n is not in\n{text}");
        }
    }

    #[test]
    fn json_has_sources_with_all_measures_and_their_sum() {
        let report = report();
        let json = report.json();
        assert_eq!(json.as_array().map(Vec::len), Some(4));
        assert_eq!(json[1]["sensor"], "kitti");
        assert_eq!(json[2]["note"], "2 sweeps: not comparable with published benchmarks");
        assert_eq!(
            (&json[2]["other_intensities"][0]["intensity"], &json[2]["other_intensities"][0]["mean_iou"]),
            (&"off".into(), &0.0.into())
        );
        assert_eq!((&json[3]["cloud"], &json[3]["n_points"]), (&"overall".into(), &7.into()));
        assert_eq!(json[3]["ranges"][1]["n_points"], 1);
        assert_eq!(json[3]["seven_classes"]["mean_iou"], 0.75);
        assert_eq!(json[3]["coverage"]["thresholds"][1]["kept"], 6.0 / 7.0);
        assert!((json[3]["calibration_error"].as_f64().expect("a number") - 0.2 / 7.0).abs() < 1e-12);
        assert!(
            report
                .csv()
                .starts_with("cloud,class,n_truth,n_predicted,precision,recall,iou\nrig-urban-1,road,3,3,1,1,1\n")
        );
    }

    #[test]
    fn chart_has_a_line_for_each_group_with_scores() {
        let svg = report().chart().expect("has scores");
        assert!(svg.contains("simulated, rig") && svg.contains("simulated, kitti") && svg.contains("SemanticKITTI"));
        let mut labels = Tally::new();
        labels.add_class(TrueClass::from_id(7), 7);
        let files = ClassReport::new(vec![source("a", Origin::Files, 0, labels)], "auto");
        assert_eq!(files.chart(), None);
        let text = files.markdown();
        assert!(text.contains("| a | - | 1 | 100.0 % | 100.0 % | 100.0 % | - |"), "{text}");
        assert!(["## Ranges", "## Calibration", "## Coverage"].iter().all(|part| !text.contains(part)), "{text}");
    }
}
