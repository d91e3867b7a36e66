//! infer: a class for every point of a submap, by the model that the settings name.
//!
//! What kind of model it is, the model file says (see `learning`). The stage keeps nothing from one submap to the next.

use learning::{Cloud, Options, Report, Segmenter};
use messages::{CLASS_TABLE_VERSION, Class, ClassHeader, Color, Submap};
use stage::{Context, Flow, Inputs, Outputs, Port, Problem, Received, Stage, StepError};
use std::path::Path;

stage::settings! {
    /// Settings of infer.
    pub struct Settings {
        /// Model file; a relative path starts at the folder of launch.toml.
        pub model: String = "models/street.safetensors".to_owned() => stage::any();
        /// The first of every so many sweeps of a submap goes through the network; points of the others take the votes of those
        /// nearby. 1 to 16; 1 is all.
        pub every: u32 = 1 => stage::within(1, 16);
    }
}

/// The stage.
pub struct Infer {
    model: Box<dyn Segmenter>,
}

impl Infer {
    /// Publishes the class column of one submap.
    fn label(&self, submap: &Received<Submap>, outputs: &mut Outputs) -> Result<(), StepError> {
        let cloud = Cloud { header: submap.header(), points: submap.rows(), colors: None };
        let n_points = cloud.points.len();
        let mut loan = outputs.loan::<Class>(n_points)?;
        *loan.header_mut() =
            ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: self.model.card().digest };
        let classes = loan.grow(n_points).ok_or_else(|| {
            StepError::data(format!("the class column of submap {} has no room for {n_points} points", submap.seq()))
        })?;
        let report = self.model.segment(&cloud, classes).map_err(StepError::data)?;
        outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        tell(report, outputs);
        Ok(())
    }
}

fn options(settings: &Settings) -> Options {
    Options { every: settings.every as usize, ..Options::default() }
}

fn tell(report: Report, outputs: &mut Outputs) {
    outputs.count("points_unseen", report.n_unseen as u64);
    if report.coarsened > 1 {
        outputs.count("submaps_coarsened", 1);
        outputs.note(format!("the model's grid was made {} times coarser: the submap is too wide", report.coarsened));
    }
}

impl Stage for Infer {
    const NAME: &'static str = "infer";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        // No architecture reads colors yet; the topic is wired so that one that does needs no other diagram.
        vec![Port::of::<Submap>(), Port::optional::<Color>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Class>()]
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let path = context.resolve(Path::new(&settings.model));
        learning::load(&path, &options(settings))
            .err()
            .map(|error| Problem::of_key("model", error.to_string()))
            .into_iter()
            .collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let path = context.resolve(Path::new(&settings.model));
        Ok(Self { model: learning::load(&path, &options(settings)).map_err(StepError::io)? })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for submap in inputs.take::<Submap>() {
            self.label(&submap, outputs)?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(stage::StateBytes::default())
    }
}
