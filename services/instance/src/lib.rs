//! instance: assigns an instance id to every vehicle and pedestrian (thesis section 6.5.2).
//!
//! The algorithm works on a top-down view of the submap with cells of 10 cm. For each class of `things`:
//! 1. The digital terrain model is computed: lowest ground point of each cell, gaps interpolated.
//! 2. Cells with points of the class below a height above the terrain are occupied.
//! 3. Occupied cells are dilated with a square of 5 cells, holes of fewer than 10 cells are filled, and connected components are
//!    extracted.
//! 4. Components with too few points for their distance, or without ground around them, are removed.
//! 5. The points of a component get its id.
//!
//! Steps 1 to 4 are in the crate `instance_segmentation`. Extensions of the thesis, each controlled by a setting: the
//! required number of points follows from the density of the LiDAR, objects that pass the same cells at different times
//! are separated, moving objects are tracked from sweep to sweep, touching roofs and heads are separated by a
//! watershed, nearby parts are joined, and an object of an earlier submap keeps its id, even if it has few points now.
//!
//! Start at `InstanceStage::label` below, which handles one submap. The stage must never reorder or drop a point: its
//! column has the length and the order of the submap. It never assigns an id twice in a drive, and never merges two ids
//! that it has published.
//!
//! The header of the column names the objects that move, so that clouds mark all their points as `dynamic`: `slam_aggregate` marks
//! the points that contradict an earlier sweep, which an object that drives along with the vehicle hardly does.
//!
//! New ids increase over the whole drive, in the order of the classes in `things`, then of the first points of the objects. In
//! submaps without ground points, the height and ground-contact filters are disabled.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod settings;

pub use settings::{Settings, Thing};

use instance_segmentation::{
    Density, Kind, Object, OwnVehicle, Rays, ThingPoint, TopView, TrackedObject, Tracker, find,
};
use messages::{
    ClassRow, ClassTopic, InstanceHeader, InstanceTopic, MAX_MOVING_INSTANCES, SubmapHeader, SubmapPoint, SubmapSweep,
    SubmapTopic,
};
use serde::{Deserialize, Serialize};
use stage::{
    Context, Flow, Inputs, Outputs, Port, Received, SavedColumn, Stage, StateBytes, StepError, SubmapJoin, decode_head,
};
use std::collections::BTreeSet;

/// Increased when the meaning of the saved state changes.
const STATE_VERSION: u32 = 5;

/// The stage.
pub struct InstanceStage {
    settings: Settings,
    join: SubmapJoin,
    kinds: Vec<Kind>,
    /// Next new id; 0 = no instance.
    next_id: u32,
    tracker: Tracker,
    own_vehicle: OwnVehicle,
}

#[derive(Serialize, Deserialize)]
struct SavedState {
    next_id: u32,
    tracker: Tracker,
    own_vehicle: OwnVehicle,
    join: Vec<SavedColumn>,
}

impl InstanceStage {
    /// Publishes the instance column of one submap. Without `classes` all ids are 0.
    fn label(
        &mut self,
        submap: &Received<SubmapTopic>,
        classes: &[ClassRow],
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        let n_points = submap.rows().len();
        let mut loan = outputs.loan::<InstanceTopic>(n_points)?;
        let ids = loan.grow(n_points)?;
        let header = self.assign_ids(submap, classes, ids, outputs)?;
        *loan.header_mut() = header;
        outputs.publish_column(loan, submap.stamp(), submap.seq())
    }

    /// Writes the id of every point that belongs to an instance. All ids must be 0 before the call.
    fn assign_ids(
        &mut self,
        submap: &Received<SubmapTopic>,
        classes: &[ClassRow],
        ids: &mut [u32],
        outputs: &mut Outputs,
    ) -> Result<InstanceHeader, StepError> {
        let mut header = InstanceHeader::default();
        let mut moving = BTreeSet::new();
        let mut seen: Vec<TrackedObject> = Vec::new();
        let mut seen_ids = BTreeSet::new();
        let mut view = self.view(submap.rows(), classes, outputs);
        let checked = submap.header().checked(submap.seq())?;
        if let Some(view) = &mut view {
            self.leave_out_own_vehicle(view, checked.sweeps, submap.rows(), outputs);
        }
        let odom_from_submap = checked.odom_from_submap;
        let density = Density::from_sweeps(checked.sweeps, submap.rows());
        let rays = Rays::new(checked.sweeps, submap.rows());
        for kind in self.kinds.clone() {
            let Some(view) = &view else { break };
            let found = self.find(view, submap, &rays, classes, &kind);
            let mut tracked: Vec<TrackedObject> = found
                .iter()
                .map(|object| TrackedObject::from_object(object, &kind, &view.grid, &odom_from_submap))
                .collect();
            let known = self.tracker.associate(&tracked, self.settings.min_overlap);
            for ((object, track), known) in found.iter().zip(&mut tracked).zip(known) {
                let required = kind.required_points(density.expected(submap.rows(), &object.points, &kind));
                if !object.is_grounded {
                    outputs.count("things_without_ground_around", u64::from(object.points.len() >= required));
                    continue;
                }
                track.id = match known {
                    Some(known) => known.id,
                    None if object.points.len() < required => continue,
                    None if mean_score(object, classes) < kind.min_score => {
                        outputs.count("things_below_min_score", 1);
                        continue;
                    }
                    None => self.new_id()?,
                };
                outputs.count("instances_of_earlier_submaps", u64::from(known.is_some()));
                object.points.iter().for_each(|&point_idx| ids[point_idx as usize] = track.id);
                // Pieces of one moving object have one id.
                header.n_instances += u32::from(seen_ids.insert(track.id));
                header.n_points += object.points.len() as u32;
                if object.motion.is_some() || known.is_some_and(|known| known.moves_on) {
                    moving.insert(track.id);
                }
            }
            seen.extend(tracked.into_iter().filter(|track| track.id != 0));
        }
        self.tracker.update(seen, self.settings.remembered_submaps);
        outputs.count("instances", u64::from(header.n_instances));
        outputs.count("moving_instances", moving.len() as u64);
        let n_unnamed = moving.len().saturating_sub(MAX_MOVING_INSTANCES);
        if n_unnamed > 0 {
            outputs.count("moving_instances_unmarked", n_unnamed as u64);
            outputs.note(format!(
                "a submap has more than {MAX_MOVING_INSTANCES} moving instances: the points of the others are not marked as dynamic"
            ));
        }
        header.set_moving(moving);
        Ok(header)
    }

    /// The top-down view of a submap. `None` without points of the classes of `things`.
    fn view(&self, points: &[SubmapPoint], classes: &[ClassRow], outputs: &mut Outputs) -> Option<TopView> {
        let is_thing: [bool; 256] = std::array::from_fn(|id| self.kinds.iter().any(|kind| kind.class as usize == id));
        if !classes.iter().any(|row| is_thing[usize::from(row.class_id)]) {
            return None;
        }
        let view = TopView::around(points, classes, &is_thing, self.settings.cell_m);
        if let Some(view) = &view {
            report(view, &self.settings, outputs);
        } else {
            outputs.count("submaps_without_view", 1);
            outputs.note("the objects of a submap are too far apart for a top-down view: no instances in this submap");
        }
        view
    }

    /// Removes the points of the own vehicle from the points that may be objects.
    fn leave_out_own_vehicle(
        &mut self,
        view: &mut TopView,
        sweeps: &[SubmapSweep],
        points: &[SubmapPoint],
        outputs: &mut Outputs,
    ) {
        let candidates: Vec<u32> = view.thing_points.iter().map(|point| point.point_idx).collect();
        let own = self.own_vehicle.points(sweeps, points, &candidates);
        if !own.is_empty() {
            outputs.count("points_of_own_vehicle", own.len() as u64);
            view.thing_points.retain(|point| own.binary_search(&point.point_idx).is_err());
        }
    }

    fn find(
        &self,
        view: &TopView,
        submap: &Received<SubmapTopic>,
        rays: &Rays<'_>,
        classes: &[ClassRow],
        kind: &Kind,
    ) -> Vec<Object> {
        let is_class = |point: &ThingPoint| classes[point.point_idx as usize].class_id == kind.class as u8;
        let is_class: Vec<bool> = view.thing_points.iter().map(is_class).collect();
        let header: &SubmapHeader = submap.header();
        let time_of = |point: &SubmapPoint| {
            let sweep = header.sweeps.get(usize::from(point.sweep_idx));
            sweep.map_or(0, |sweep| sweep.stamp).saturating_add(i64::from(point.offset_nanos))
        };
        find(view, submap.rows(), rays, &is_class, time_of, kind, &self.settings.footprints())
    }

    fn new_id(&mut self) -> Result<u32, StepError> {
        let id = self.next_id;
        let next = id.checked_add(1);
        self.next_id = next.ok_or_else(|| StepError::data("more than 2^32 - 2 instances in one drive"))?;
        Ok(id)
    }
}

/// Mean class score of the points, 0 to 1.
fn mean_score(object: &Object, classes: &[ClassRow]) -> f64 {
    let sum: u64 = object.points.iter().map(|&point_idx| u64::from(classes[point_idx as usize].score)).sum();
    sum as f64 / (255 * object.points.len()) as f64
}

/// Reports limits of the view.
fn report(view: &TopView, settings: &Settings, outputs: &mut Outputs) {
    if view.terrain_m.is_none() {
        outputs.count("submaps_without_ground", 1);
        outputs.note("no ground points in a submap: height and ground-contact filters disabled");
    }
    if view.grid.cell_m > settings.cell_m {
        outputs.count("submaps_coarsened", 1);
        outputs.note(format!(
            "a submap is too large for cells of {} m: cells of {} m used",
            settings.cell_m, view.grid.cell_m
        ));
    }
}

impl Stage for InstanceStage {
    const NAME: &'static str = "instance";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>(), Port::of::<ClassTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<InstanceTopic>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        Ok(Self {
            settings: settings.clone(),
            kinds: settings.kinds(),
            join: SubmapJoin::new(context.mode).column::<ClassTopic>(true),
            next_id: 1,
            tracker: Tracker::default(),
            own_vehicle: OwnVehicle::default(),
        })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.join.take(inputs)?;
        while let Some(joined) = self.join.next_complete() {
            // Live, a submap whose classes were lost gets no instances.
            if let Some(classes) = joined.rows::<ClassTopic>()? {
                self.label(&joined.submap, classes, outputs)?;
            }
        }
        self.join.check_bounds()?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(joined) = self.join.take_oldest() {
            outputs.count("submaps_without_class", 1);
            self.label(&joined.submap, &[], outputs)?;
        }
        Ok(())
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let head = SavedState {
            next_id: self.next_id,
            tracker: self.tracker.clone(),
            own_vehicle: self.own_vehicle.clone(),
            join: self.join.save(),
        };
        let mut state = StateBytes::with_head(STATE_VERSION, &head)?;
        self.join.save_messages(&mut state);
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let (state, messages): (SavedState, _) = decode_head(STATE_VERSION, state)?;
        self.join.load(&state.join, messages)?;
        self.next_id = state.next_id;
        self.tracker = state.tracker;
        self.own_vehicle = state.own_vehicle;
        Ok(())
    }
}
