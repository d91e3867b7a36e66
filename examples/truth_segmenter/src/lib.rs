//! The true classes of a simulated drive, in place of infer: an upper bound for the results of the stages after it.
//!
//! ```sh
//! cargo build --release -p truth_segmenter
//! replica-launch launch.toml --set infer.program=target/release/truth-segmenter
//! ```
//!
//! The labels of a drive belong to its returns; a point is matched by the time, ring and angle of its shot.

use drive::{Drive, Shot, TrueLabels};
use stage::messages::pod::{FINGERPRINT_START, fingerprint};
use stage::messages::{CLASS_TABLE_VERSION, ClassHeader, ClassId, ClassRow, ClassTopic, SubmapTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StepError};

stage::settings! {
    /// The segmenter has no settings.
    pub struct Settings {}
}

/// The stage.
pub struct TruthSegmenter {
    labels: TrueLabels,
}

impl TruthSegmenter {
    /// Writes the classes of a submap's points. Returns the number of points without a label.
    fn label(&self, submap: &Received<SubmapTopic>, rows: &mut [ClassRow]) -> u64 {
        let header = submap.header();
        let mut n_unknown = 0;
        for (row, point) in rows.iter_mut().zip(submap.rows()) {
            // The labels belong to the first LiDAR.
            let sweep = header.sweeps.get(usize::from(point.sweep_idx)).filter(|sweep| sweep.lidar == 0);
            let label = sweep
                .and_then(|sweep| {
                    let stamp = sweep.stamp + i64::from(point.offset_nanos);
                    let shot = Shot { stamp, ring: point.ring, azimuth: Some(point.azimuth), range_m: None };
                    self.labels.find(&shot).ok()
                })
                .filter(|label| ClassId::from_id(label.class).is_some());
            n_unknown += u64::from(label.is_none());
            *row = label.map_or(ClassRow::default(), |label| ClassRow { class_id: label.class, score: 255 });
        }
        n_unknown
    }
}

impl Stage for TruthSegmenter {
    const NAME: &'static str = "infer";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>()]
    }

    fn new(_settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let drive = Drive::open(&context.drive).map_err(StepError::data)?;
        let labels = drive.true_labels().map_err(|problem| StepError::data(problem.to_string()))?;
        Ok(Self { labels })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for submap in inputs.take::<SubmapTopic>() {
            let n_points = submap.rows().len();
            let mut loan = outputs.loan::<ClassTopic>(n_points)?;
            let model_digest = fingerprint(FINGERPRINT_START, b"truth_segmenter 1");
            *loan.header_mut() = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest };
            let rows = loan.grow(n_points)?;
            outputs.count("points_without_label", self.label(&submap, rows));
            outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(stage::StateBytes::default())
    }
}
