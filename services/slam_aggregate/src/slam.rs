//! The stage.

use crate::incoming::{PreparedTick, Tick, prepared, raw};
use crate::open_submap::LoanedSubmap;
use crate::path_use::{self, PathOfDrive};
use crate::saved::{STATE_VERSION, Saved, SavedSubmap, SubmapHead};
use crate::{MotionSensor, Settings};
use drive::manifest::Manifest;
use drive::{Drive, LiveRig};
use geometry::{Isometry3, Pose};
use georeference::{
    GeoreferenceSettings, Georeferencer, GivenPlacing, InertialUnit, PathSource, Placed, fix_doubts, path_difference,
};
use given_path::GivenPath;
use messages::{
    GnssTopic, ImuTopic, PlacementTopic, StampedPose, SubmapPoint, SubmapTopic, SweepTopic, TrajectoryTopic, pod,
};
use registration::{
    Algorithm, BodyPoses, PreparedSweep, RawSweep, Registered, SecondaryLidar, SelectedOdometry, SensorMounting,
    Stretches, SweepRows, SweepsByTick, sweeps_by_tick,
};
use stage::{
    Context, Flow, Inputs, Mode, Outputs, Port, Problem, Stage, StateBytes, StepError, decode_head, next_message,
};
use std::borrow::Cow;

/// The stage; see the crate's page.
pub struct SlamAggregate {
    settings: Settings,
    mounting: SensorMounting,
    georeference: GeoreferenceSettings,
    odometry: SelectedOdometry,
    /// The secondary LiDARs.
    secondary_lidars: Vec<SecondaryLidar>,
    /// The first tick, until the second arrives.
    waiting: Option<Tick>,
    open: Option<LoanedSubmap>,
    /// The open submap of a loaded state, until the next tick has a loan for it.
    saved_submap: Option<SavedSubmap>,
    poses: BodyPoses,
    stretches: Stretches,
    inertial: InertialUnit,
    georeferencer: Georeferencer,
    /// Whether the drive has a GNSS receiver whose fixes should place the result.
    expects_fixes: bool,
    /// The post-processed trajectory of the drive.
    path: PathOfDrive,
    /// Submaps that are placed by it.
    given: GivenPlacing,
}

impl SlamAggregate {
    /// The stage with a known mounting of the LiDAR; antenna and inertial unit are at the body's origin.
    pub fn with_mounting(settings: &Settings, body_from_lidar: Pose) -> Self {
        Self::with_sensors(settings, body_from_lidar, settings.georeference(None))
    }

    fn with_sensors(settings: &Settings, body_from_lidar: Pose, georeference: GeoreferenceSettings) -> Self {
        let mounting = SensorMounting {
            body_from_lidar,
            imu_in_body: georeference.imu_in_body,
            antenna_in_body: georeference.antenna_in_body,
        };
        Self {
            settings: settings.clone(),
            mounting,
            georeferencer: Georeferencer::new(&georeference),
            georeference,
            // The body frame at the first shot is odom.
            odometry: SelectedOdometry::new(settings.odometry(mounting), settings.algorithm(), body_from_lidar),
            secondary_lidars: Vec::new(),
            waiting: None,
            open: None,
            saved_submap: None,
            poses: BodyPoses::default(),
            stretches: Stretches::default(),
            inertial: settings.inertial_unit(&mounting),
            expects_fixes: false,
            path: PathOfDrive::default(),
            given: GivenPlacing::default(),
        }
    }

    /// The stage with a post-processed trajectory.
    fn with_path(mut self, path: PathOfDrive) -> Self {
        self.path = path;
        if let Some(path) = self.used_path() {
            self.georeference.origin = path_use::origin(path);
        }
        let settings = self.settings.odometry(self.mounting);
        self.odometry = SelectedOdometry::new(settings, self.algorithm(), self.mounting.body_from_lidar);
        self
    }

    /// The path that gives the poses of the sweeps.
    fn given_path(&self) -> Option<&GivenPath> {
        self.used_path().filter(|_| self.settings.path == PathSource::Given)
    }

    /// The path that results depend on.
    fn used_path(&self) -> Option<&GivenPath> {
        self.path.path.as_ref().filter(|_| self.settings.path != PathSource::Odometry)
    }

    /// Converts the sensor data up to the last sweep to measurements of submaps.
    fn update_measurements(&mut self) {
        self.georeferencer.update(&self.georeference);
        let path = self.path.path.as_ref().filter(|_| self.settings.path == PathSource::Refined);
        if let Some(path) = path {
            self.georeferencer.add_path(path.trajectory(), |stamp| path.deviation_at(stamp));
        }
    }

    /// Fingerprint of the path that results depend on; 0 without it.
    fn path_fingerprint(&self) -> u64 {
        self.used_path().map_or(0, GivenPath::fingerprint)
    }

    fn algorithm(&self) -> Algorithm {
        self.given_path().map_or_else(|| self.settings.algorithm(), |path| Algorithm::Given(path.trajectory().clone()))
    }

    /// Adds a registered sweep and the sweeps of the secondary LiDARs to the open submap, publishes the submap if it is
    /// full, and appends the poses.
    fn add_tick(
        &mut self,
        prepared: &PreparedTick,
        registered: &Registered,
        poses: &mut Vec<StampedPose>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        registered.counts().into_iter().for_each(|(name, n)| outputs.count(name, n));
        let body_from_lidar = &self.mounting.body_from_lidar;
        if !registered.is_given() {
            self.inertial.compare(registered, body_from_lidar, &mut self.odometry, &mut self.georeferencer);
            self.stretches.add(registered).into_iter().for_each(|text| outputs.note(text));
        }
        let n_dropped = prepared.sweeps.iter().map(|sweep| sweep.kept.n_dropped as u64).sum();
        outputs.count("points_out_of_range", n_dropped);
        let ([begin, end], n_left_out) = self.poses.add(registered, body_from_lidar, poses);
        outputs.count_all([("poses_out_of_order", n_left_out)]);
        if self.open.as_ref().is_some_and(|open| !open.fits(prepared.tick.len(), prepared.n_kept())) {
            self.close_submap(outputs)?;
        }
        let open = match &mut self.open {
            Some(open) => open,
            empty => {
                let loan = outputs.loan::<SubmapTopic>(self.settings.submap_points_max as usize)?;
                let open = empty.insert(LoanedSubmap::new(loan, &begin, 1 + self.secondary_lidars.len()));
                let odom_from_submap = open.submap.frame.odom_from_submap;
                match &self.path.path {
                    Some(path) if registered.is_given() => {
                        let deviation = path.deviation_at(registered.stamp);
                        self.given.begin_submap(odom_from_submap, registered.stamp, deviation);
                    }
                    _ => self.georeferencer.begin_submap(odom_from_submap, registered.stamp.0),
                }
                open
            }
        };
        if !registered.is_given() {
            self.georeferencer.add_sweep(registered, &begin, &end);
        }
        let body = end.translation.vector;
        for (received, PreparedSweep { sweep, kept }) in prepared.tick.iter().zip(&prepared.sweeps) {
            let rows = SweepRows { raw: raw(received), sweep, kept };
            match received.header().lidar {
                0 => open.append(rows, registered, body)?,
                lidar => {
                    let lidar = self.secondary_lidars.get_mut(lidar as usize - 1).ok_or_else(|| {
                        StepError::data(format!("sweep {}: LiDAR {lidar} is not in drive.toml", received.seq()))
                    })?;
                    let followed = lidar.follow(sweep, registered);
                    outputs.count("points_moving", followed.moving.len() as u64);
                    open.append(rows, &followed, body)?;
                }
            }
        }
        if open.submap.frame.path_m >= self.settings.submap_m || open.submap.seconds() >= self.settings.submap_s {
            self.close_submap(outputs)?;
        }
        Ok(())
    }

    fn close_submap(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Some(open) = self.open.take() else { return Ok(()) };
        let is_loop = self.georeferencer.end_submap(&self.georeference, self.odometry.map());
        outputs.count("loops_found", u64::from(is_loop));
        open.publish(outputs)
    }

    /// Publishes the placement by the given path.
    fn finish_given(&self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Some(path) = self.given_path() else { return Ok(()) };
        let placed = self.given.placed(path_use::origin(path));
        placed.map_or(Ok(()), |placed| publish_placement(&placed, outputs))
    }

    /// Moves the open submap of a loaded state into a loan.
    fn reopen_submap(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        if let Some(saved) = self.saved_submap.take() {
            self.open = Some(saved.reopen(outputs, self.settings.submap_points_max as usize)?);
        }
        Ok(())
    }
}

impl Stage for SlamAggregate {
    const NAME: &'static str = "slam_aggregate";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SweepTopic>(), Port::optional::<GnssTopic>(), Port::optional::<ImuTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>(), Port::of::<TrajectoryTopic>(), Port::of::<PlacementTopic>()]
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let is_cut = settings.imls_h_m > settings.imls_radius_m;
        let text = "must be at most imls_radius_m: the weights of the surface end at the radius";
        let cut = is_cut.then(|| Problem::for_key("imls_h_m", text));
        cut.into_iter().chain(path_use::problems(settings, context)).collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let mut path = PathOfDrive::default();
        let manifest = match context.mode {
            Mode::Offline => {
                let drive = Drive::open(&context.drive).map_err(StepError::io)?;
                path = path_use::from_drive(settings, &drive)?;
                Some(drive.manifest().clone())
            }
            // The recording has only started. Without a rig, body and LiDAR frame are the same.
            Mode::Live => LiveRig::find(&context.drive).map_err(StepError::io)?.manifest().cloned(),
        };
        let rig = manifest.as_ref().map(Manifest::rig).transpose().map_err(StepError::data)?;
        let body_from_lidar = rig.as_ref().map_or_else(Isometry3::identity, |rig| rig.body_from_lidar);
        let other = |body_from_other: &Pose| SecondaryLidar::new(&body_from_lidar, body_from_other);
        let secondary_lidars = rig.iter().flat_map(|rig| &rig.body_from_other_lidars).map(other).collect();
        let georeference = settings.georeference(manifest.as_ref());
        let has_receiver =
            manifest.is_some_and(|manifest| manifest.gnss.is_some()) && context.is_connected::<GnssTopic>();
        let expects_fixes = has_receiver && georeference.gnss;
        let stage =
            Self { secondary_lidars, expects_fixes, ..Self::with_sensors(settings, body_from_lidar, georeference) };
        Ok(stage.with_path(path))
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.reopen_submap(outputs)?;
        for message in inputs.take::<ImuTopic>() {
            self.inertial.add(message.rows(), &mut self.odometry, &mut self.georeferencer, &self.georeference);
        }
        for message in inputs.take::<GnssTopic>() {
            let n_valid = self.georeferencer.add_gnss(message.rows(), &self.georeference);
            outputs.count("fixes", n_valid as u64);
            outputs.count("fixes_without_position", (message.rows().len() - n_valid) as u64);
            if self.settings.predicts_by(MotionSensor::Gnss) {
                let velocities = message.rows().iter().filter_map(|row| self.georeferencer.velocity(row));
                velocities.for_each(|velocity| self.odometry.add_gnss(velocity));
            }
        }
        let mut poses = Vec::new();
        let SweepsByTick { ticks, n_dropped } = sweeps_by_tick(inputs.take::<SweepTopic>(), raw);
        outputs.count_all([("sweeps_without_first_lidar", n_dropped)]);
        for tick in ticks {
            let raws: Vec<RawSweep<'_>> = tick.iter().map(raw).collect();
            if let Some(path) = self.used_path() {
                path_use::covers(path, raws[0].seq, raws[0].stamp, raws[0].header.duration_nanos)?;
            }
            let odometry = &mut self.odometry;
            let settings = &self.settings;
            let sweep = raws[0].sweep(settings.untimed_turn(odometry.turning_at(raws[0].stamp)));
            let others = || raws[1..].iter().map(|raw| prepared(raw, settings)).collect::<Vec<_>>();
            let (registered, (kept, others)) =
                rayon::join(|| odometry.register(&sweep), || (settings.kept_points(&sweep), others()));
            let registered = registered.map_err(StepError::data)?;
            let sweeps = std::iter::once(PreparedSweep { sweep, kept }).chain(others).collect();
            let waiting = self.waiting.take().map(|tick| PreparedTick::new(tick, &self.settings));
            let mut prepared = waiting.into_iter().chain([PreparedTick { tick, sweeps }]);
            for (registered, tick) in registered.iter().zip(prepared.by_ref()) {
                self.add_tick(&tick, registered, &mut poses, outputs)?;
            }
            self.waiting = prepared.next().map(|prepared| prepared.tick);
        }
        self.update_measurements();
        outputs.publish_rows::<TrajectoryTopic>(&poses, |pose| pose.stamp)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.reopen_submap(outputs)?;
        let mut poses = Vec::new();
        if let (Some(registered), Some(tick)) = (self.odometry.finish(), self.waiting.take()) {
            let prepared = PreparedTick::new(tick, &self.settings);
            self.add_tick(&prepared, &registered, &mut poses, outputs)?;
        }
        outputs.publish_rows::<TrajectoryTopic>(&poses, |pose| pose.stamp)?;
        self.odometry.turning_note().into_iter().for_each(|text| outputs.note(text));
        self.stretches.finish().into_iter().for_each(|text| outputs.note(text));
        self.close_submap(outputs)?;
        self.inertial.summary().into_iter().for_each(|line| outputs.note(line));
        self.inertial.doubt().into_iter().for_each(|doubt| outputs.report_doubt(&doubt));
        self.path.notes.iter().for_each(|note| outputs.note(note));
        if self.given_path().is_some() {
            return self.finish_given(outputs);
        }
        if let Some(doubt) = self.stretches.contested(self.settings.max_contested_s) {
            outputs.report_doubt(&doubt);
        }
        // Fixes do not excuse it: without matches, the points of a submap do not fit each other.
        if let Some(doubt) = self.stretches.unmatched(self.settings.max_unmatched_s) {
            outputs.report_doubt(&doubt);
        }
        self.update_measurements();
        let placed = self.georeferencer.solve(&self.georeference);
        // Fixes correct the path, and export reports doubts about the remaining deviations.
        let has_fixes = placed.as_ref().is_some_and(|placed| placed.header.n_fixes > 0 || placed.steps.is_some());
        if let Some(doubt) = self.stretches.lost(self.settings.max_lost_m).filter(|_| !has_fixes) {
            outputs.report_doubt(&doubt);
        }
        if self.georeference.gnss {
            let counted = ["fixes", "fixes_without_position"].map(|name| outputs.counted(name));
            let min_used_share = self.settings.min_used_fixes_share;
            for doubt in fix_doubts(counted, self.expects_fixes, placed.as_ref(), min_used_share) {
                outputs.report_doubt(&doubt);
            }
        }
        let Some(placed) = placed else { return Ok(()) };
        if let Some(path) = self.path.path.as_ref().filter(|_| self.settings.path == PathSource::Odometry) {
            outputs.note(path_difference(&placed, path.trajectory(), path.local_frame()));
        }
        publish_placement(&placed, outputs)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let (submap, rows) = match (&self.open, &self.saved_submap) {
            (Some(open), _) => (Some(SubmapHead::from_submap(open)), pod::bytes_from_rows(open.loan.rows())),
            (None, Some(saved)) => (Some(saved.head.clone()), &saved.rows[..]),
            (None, None) => (None, &[][..]),
        };
        let saving = Saved {
            odometry: self.odometry.save(),
            n_waiting: self.waiting.as_ref().map_or(0, |tick| tick.len() as u32),
            submap,
            poses: self.poses,
            secondary_lidars: Cow::Borrowed(&self.secondary_lidars),
            stretches: Cow::Borrowed(&self.stretches),
            inertial: Cow::Borrowed(&self.inertial),
            georeferencer: Cow::Borrowed(&self.georeferencer),
            given: Cow::Borrowed(&self.given),
            path: self.path_fingerprint(),
        };
        let mut state = StateBytes::with_head(STATE_VERSION, &saving)?;
        self.waiting.iter().flatten().for_each(|waiting| state.push(waiting));
        state.push_rows(rows, size_of::<SubmapPoint>());
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let (saved, mut rest): (Saved<'_>, _) = decode_head(STATE_VERSION, state)?;
        let settings = self.settings.odometry(self.mounting);
        let algorithm = self.algorithm();
        self.odometry = SelectedOdometry::load(settings, algorithm, saved.odometry).map_err(StepError::data)?;
        let waiting = (0..saved.n_waiting).map(|_| next_message(&mut rest)).collect::<Result<Tick, _>>()?;
        self.waiting = Some(waiting).filter(|tick| !tick.is_empty());
        self.open = None;
        self.saved_submap = SavedSubmap::load(saved.submap, rest)?;
        self.poses = saved.poses;
        self.secondary_lidars = saved.secondary_lidars.into_owned();
        self.stretches = saved.stretches.into_owned();
        self.inertial = saved.inertial.into_owned();
        self.georeferencer = saved.georeferencer.into_owned();
        self.given = saved.given.into_owned();
        if saved.path != self.path_fingerprint() {
            return Err(StepError::data(
                "the file of [trajectory] has changed since the state was saved; restore it, or start the run anew",
            ));
        }
        Ok(())
    }
}

fn publish_placement(placed: &Placed, outputs: &mut Outputs) -> Result<(), StepError> {
    outputs.note(&placed.summary);
    let mut loan = outputs.loan::<PlacementTopic>(placed.rows.len())?;
    *loan.header_mut() = placed.header;
    loan.extend_from_slice(&placed.rows)?;
    outputs.publish(loan, placed.rows.first().map_or(0, |row| row.stamp))
}
