//! instance: one number per vehicle and pedestrian (thesis section 6.5.2).
//!
//! A top-down view of the submap in cells of 10 cm, and for each class of things:
//! 1. the terrain: lowest ground point of each cell, gaps bridged (DEM);
//! 2. cells with points of the class that lie below a height over the terrain;
//! 3. joined by a dilation with a square of 5 cells, holes of fewer than 10 cells filled, connected components;
//! 4. components with too few points, or with points but no ground around them, are dropped;
//! 5. the points get their component's number.
//!
//! Beyond the thesis, each a setting: what passed through the same cells at different times is told apart (`visits`), roofs and
//! heads that touch are parted by watershed (`footprints`), near parts are joined (`objects`), and a thing that was in an
//! earlier submap keeps its id (`memory`), whatever the number of its points now.
//!
//! New ids count up over the whole drive, in the order of the classes in `things`, then of the things' first points. Where a
//! submap has no ground, heights and surroundings are not asked.

mod footprints;
mod memory;
mod objects;
mod pairing;
mod settings;
mod top_view;
mod visits;

pub use settings::{Settings, Thing};

use geometry::Pose;
use memory::{Memory, Remembered};
use messages::{Class, ClassRow, Instance, InstanceHeader, Submap, SubmapHeader, SubmapPoint};
use objects::Object;
use pairing::{Pairing, SavedPairing};
use serde::{Deserialize, Serialize};
use settings::Kind;
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StepError};
use top_view::TopView;

/// Raised when the saved state changes its meaning.
const STATE_VERSION: u32 = 2;

/// The stage.
pub struct InstanceStage {
    settings: Settings,
    pairing: Pairing,
    kinds: Vec<Kind>,
    /// Id of the next thing; 0 is no thing.
    next_id: u32,
    memory: Memory,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    next_id: u32,
    memory: Memory,
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
        let header = self.number(submap, classes, ids, outputs)?;
        *loan.header_mut() = header;
        outputs.publish_column(loan, submap.stamp(), submap.seq())
    }

    /// Writes the id of every point that belongs to a thing; the others are 0 already.
    fn number(
        &mut self,
        submap: &Received<Submap>,
        classes: &[ClassRow],
        ids: &mut [u32],
        outputs: &mut Outputs,
    ) -> Result<InstanceHeader, StepError> {
        let mut header = InstanceHeader::default();
        let mut seen: Vec<Remembered> = Vec::new();
        let view = self.view(submap.rows(), classes, outputs);
        let world_from_submap = pose(submap)?;
        for kind in self.kinds.clone() {
            let Some(view) = &view else { break };
            let found = self.find(view, submap, classes, &kind);
            let class = kind.class as u8;
            let mut things: Vec<Remembered> =
                found.iter().map(|object| Remembered::of(object, class, &view.grid, &world_from_submap)).collect();
            let known = self.memory.recognize(&things, self.settings.min_overlap);
            for ((object, thing), known) in found.iter().zip(&mut things).zip(known) {
                if !object.is_grounded {
                    outputs.count("things_without_ground_around", u64::from(object.points.len() >= kind.min_points));
                    continue;
                }
                thing.id = match known {
                    Some(id) => id,
                    None if object.points.len() < kind.min_points => continue,
                    None if mean_score(object, classes) < kind.min_score => continue,
                    None => self.new_id()?,
                };
                outputs.count("instances_of_earlier_submaps", u64::from(known.is_some()));
                object.points.iter().for_each(|&point_idx| ids[point_idx as usize] = thing.id);
                header.n_instances += 1;
                header.n_points += object.points.len() as u32;
            }
            seen.extend(things.into_iter().filter(|thing| thing.id != 0));
        }
        self.memory.update(seen, self.settings.remembered_submaps);
        outputs.count("instances", u64::from(header.n_instances));
        Ok(header)
    }

    /// The view of a submap that has things.
    fn view(&self, points: &[SubmapPoint], classes: &[ClassRow], outputs: &mut Outputs) -> Option<TopView> {
        let is_thing: [bool; 256] = std::array::from_fn(|id| self.kinds.iter().any(|kind| kind.class as usize == id));
        if !classes.iter().any(|row| is_thing[usize::from(row.class_id)]) {
            return None;
        }
        let view = TopView::around(points, classes, &is_thing, self.settings.cell_m);
        if let Some(view) = &view {
            tell(view, &self.settings, outputs);
        } else {
            outputs.count("submaps_without_view", 1);
            outputs.note("a submap's things are too far apart for a top-down view: it has no instances");
        }
        view
    }

    fn find(&self, view: &TopView, submap: &Received<Submap>, classes: &[ClassRow], kind: &Kind) -> Vec<Object> {
        let is_class = |&(point_idx, _): &(u32, _)| classes[point_idx as usize].class_id == kind.class as u8;
        let is_class: Vec<bool> = view.of_things.iter().map(is_class).collect();
        let header: &SubmapHeader = submap.header();
        let time_of = |point: &SubmapPoint| {
            let sweep = header.sweeps.get(usize::from(point.sweep_idx));
            sweep.map_or(0, |sweep| sweep.stamp).saturating_add(i64::from(point.offset_nanos))
        };
        objects::find(view, submap.rows(), &is_class, time_of, kind, &self.settings)
    }

    fn new_id(&mut self) -> Result<u32, StepError> {
        let id = self.next_id;
        let next = id.checked_add(1);
        self.next_id = next.ok_or_else(|| StepError::data("more than 2^32 - 2 instances in one drive"))?;
        Ok(id)
    }
}

/// 0 to 1.
fn mean_score(object: &Object, classes: &[ClassRow]) -> f64 {
    let sum: u64 = object.points.iter().map(|&point_idx| u64::from(classes[point_idx as usize].score)).sum();
    sum as f64 / (255 * object.points.len()) as f64
}

fn pose(submap: &Received<Submap>) -> Result<Pose, StepError> {
    let row = submap.header().world_from_submap;
    row.to_pose().ok_or_else(|| StepError::data(format!("submap {}: {row:?} is no rigid transform", submap.seq())))
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
        Ok(Self {
            settings: settings.clone(),
            kinds: settings.kinds(),
            pairing: Pairing::new(context.mode),
            next_id: 1,
            memory: Memory::default(),
        })
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

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        let state = SavedState { next_id: self.next_id, memory: self.memory.clone(), pairing: self.pairing.save() };
        Ok(stage::encode_state(STATE_VERSION, &state)?.into())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let state: SavedState = stage::decode_state(STATE_VERSION, state)?;
        self.pairing.load(&state.pairing)?;
        self.next_id = state.next_id;
        self.memory = state.memory;
        Ok(())
    }
}
