//! instance: one number per vehicle and pedestrian (thesis section 6.5.2).
//!
//! A top-down view of the submap in cells of 10 cm, and for each class of things:
//! 1. the terrain: lowest ground point of each cell, gaps bridged (DEM);
//! 2. cells with points of the class that lie below a height over the terrain;
//! 3. joined by a dilation with a square of 5 cells, holes of fewer than 10 cells filled, connected components;
//! 4. components with too few points, or with points but no ground around them, are dropped;
//! 5. the points get their component's number.
//!
//! Numbers count up over the whole drive, first vehicles, then pedestrians, each in raster order of the submap's frame. A
//! thing that lies across the border of two submaps gets two numbers: they are not matched yet.
//!
//! Where a submap has no ground, heights and surroundings are not asked.

mod objects;
mod pairing;
mod settings;
mod top_view;

pub use settings::Settings;

use messages::{Class, ClassRow, Instance, InstanceHeader, Submap, SubmapPoint};
use pairing::{Pairing, SavedPairing};
use serde::{Deserialize, Serialize};
use settings::Thing;
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StepError};
use top_view::TopView;

/// Raised when the saved state changes its meaning.
const STATE_VERSION: u32 = 1;

/// The stage.
pub struct InstanceStage {
    settings: Settings,
    pairing: Pairing,
    /// Id of the next thing; 0 is no thing.
    next_id: u32,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    next_id: u32,
    pairing: SavedPairing,
}

impl InstanceStage {
    /// Publishes the instance column of one submap; `classes` may be empty, then there are no things.
    fn label(
        &mut self,
        submap: &Received<Submap>,
        classes: &[ClassRow],
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let n_points = submap.rows().len();
        let mut loan = outputs.loan::<Instance>(n_points)?;
        let ids = loan.grow(n_points).ok_or_else(|| {
            StepError::data(format!("the instance column of submap {} has no room for {n_points} points", submap.seq()))
        })?;
        let header = self.number(submap.rows(), classes, ids, outputs)?;
        *loan.header_mut() = header;
        outputs.publish_column(loan, submap.stamp(), submap.seq())
    }

    /// Writes the id of every point that belongs to a thing; the others are 0 already.
    fn number(
        &mut self,
        points: &[SubmapPoint],
        classes: &[ClassRow],
        ids: &mut [u32],
        outputs: &mut Outputs,
    ) -> Result<InstanceHeader, StepError> {
        let mut header = InstanceHeader::default();
        let things = self.settings.things();
        let is_thing = |class_id: u8| things.iter().any(|thing| thing.class as u8 == class_id);
        if !classes.iter().any(|row| is_thing(row.class_id)) {
            return Ok(header);
        }
        let Some(view) = TopView::around(points, classes, is_thing, self.settings.cell_m) else {
            outputs.count("submaps_without_view", 1);
            outputs.note("a submap's things are too far apart for a top-down view: it has no instances");
            return Ok(header);
        };
        tell(&view, &self.settings, outputs);
        for thing in things {
            let found = self.number_class(&view, points, classes, thing, ids)?;
            header.n_instances += found.n;
            header.n_points += found.members.len() as u32;
            outputs.count("things_without_ground_around", u64::from(found.n_afloat));
        }
        outputs.count("instances", u64::from(header.n_instances));
        Ok(header)
    }

    fn number_class(
        &mut self,
        view: &TopView,
        points: &[SubmapPoint],
        classes: &[ClassRow],
        thing: Thing,
        ids: &mut [u32],
    ) -> Result<objects::Objects, StepError> {
        let found = objects::find(view, points, classes, thing, &self.settings);
        let next_id = self.next_id.checked_add(found.n);
        let next_id = next_id.ok_or_else(|| StepError::data("more than 2^32 - 1 instances in one drive"))?;
        for &(point_idx, number) in &found.members {
            ids[point_idx] = self.next_id + number;
        }
        self.next_id = next_id;
        Ok(found)
    }
}

fn tell(view: &TopView, settings: &Settings, outputs: &mut Outputs) {
    if view.terrain_m.is_none() {
        outputs.count("submaps_without_ground", 1);
        outputs.note("a submap has things but no ground: heights and surroundings were not asked");
    }
    if view.grid.cell_m > settings.cell_m {
        outputs.count("submaps_coarsened", 1);
        outputs
            .note(format!("a submap is too wide for cells of {} m: they were {} m", settings.cell_m, view.grid.cell_m));
    }
}

impl Stage for InstanceStage {
    const NAME: &'static str = "instance";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Submap>(), Port::of::<Class>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Instance>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        Ok(Self { settings: settings.clone(), pairing: Pairing::new(context.mode), next_id: 1 })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.pairing.take(inputs);
        while let Some((submap, classes)) = self.pairing.next()? {
            self.label(&submap, classes.rows(), outputs)?;
        }
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(submap) = self.pairing.next_without_class() {
            outputs.count("submaps_without_class", 1);
            self.label(&submap, &[], outputs)?;
        }
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, StepError> {
        let state = SavedState { next_id: self.next_id, pairing: self.pairing.save() };
        Ok(stage::encode_state(STATE_VERSION, &state)?)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let state: SavedState = stage::decode_state(STATE_VERSION, state)?;
        self.pairing.load(&state.pairing)?;
        self.next_id = state.next_id;
        Ok(())
    }
}
