//! {name}: a stage of REPLICA that classifies points by their height.

use stage::messages::{CLASS_TABLE_VERSION, ClassId, ClassRow, ClassTopic, SubmapTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Stage, StateBytes, StepError};

stage::settings! {
    /// Settings of the stage.
    pub struct Settings {
        /// Height above the lowest point up to which a point is ground, m.
        pub ground_m: f32 = 0.3 => stage::within(0.0, 100.0);
    }
}

struct NewStage {
    settings: Settings,
}

impl Stage for NewStage {
    const NAME: &'static str = "{name}";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>()]
    }

    fn new(settings: &Settings, _context: &Context) -> Result<Self, StepError> {
        Ok(Self { settings: settings.clone() })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for submap in inputs.take::<SubmapTopic>() {
            let points = submap.rows();
            let lowest_m = points.iter().map(|point| point.z).fold(f32::INFINITY, f32::min);
            let mut loan = outputs.loan::<ClassTopic>(points.len())?;
            loan.header_mut().class_table_version = CLASS_TABLE_VERSION;
            loan.grow_with(points.len(), |i| {
                let is_ground = points[i].z - lowest_m <= self.settings.ground_m;
                let class = if is_ground { ClassId::Ground } else { ClassId::Unlabeled };
                ClassRow { class_id: class as u8, score: 128 }
            })?;
            outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        // Nothing is kept between ticks.
        Ok(StateBytes::default())
    }
}

fn main() -> std::process::ExitCode {
    stage::run::<NewStage>()
}
