//! The stage.

use crate::Settings;
use crate::incoming::IncomingSweep;
use crate::open_submap::LoanedSubmap;
use crate::saved::{STATE_VERSION, Saved, SavedSubmap, SubmapHead};
use formats::drive::{Drive, LiveRig};
use geometry::{Isometry3, Pose};
use georeference::{FixDoubt, GeoreferenceSettings, Georeferencer, Placed};
use messages::{
    GnssTopic, ImuRow, ImuTopic, PlacementTopic, StampedPose, SubmapTopic, SweepTopic, TrajectoryTopic, pod,
};
use registration::{
    GroundVelocity, InertialCheck, InertialSample, KeptPoints, Registered, SelectedOdometry, SensorMounting, Stretches,
};
use stage::{
    Context, Flow, Inputs, Mode, Outputs, Port, Problem, Received, Stage, StateBytes, StepError, decode_head,
    next_message,
};
use std::borrow::Cow;

/// The stage; see the crate's page.
pub struct SlamAggregate {
    settings: Settings,
    mounting: SensorMounting,
    georeference: GeoreferenceSettings,
    odometry: SelectedOdometry,
    /// The first sweep, until the second arrives.
    waiting: Option<Received<SweepTopic>>,
    open: Option<LoanedSubmap>,
    /// From a loaded state, until the next tick has a loan for it.
    saved_submap: Option<SavedSubmap>,
    last_pose_stamp: Option<i64>,
    stretches: Stretches,
    inertial: InertialCheck,
    georeferencer: Georeferencer,
    /// The drive has a GNSS receiver whose fixes should place the result.
    expects_fixes: bool,
}

impl SlamAggregate {
    /// With a known mounting of the LiDAR; antenna and inertial unit are at the body's origin.
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
            // The body frame at the first shot is the world.
            odometry: SelectedOdometry::new(settings.odometry(mounting), settings.algorithm(), body_from_lidar),
            waiting: None,
            open: None,
            saved_submap: None,
            last_pose_stamp: None,
            stretches: Stretches::default(),
            inertial: InertialCheck::new(mounting.imu_in_body, settings.imu_probation),
            expects_fixes: false,
        }
    }

    /// Adds a registered sweep to the open submap, publishes the submap if it is full, and appends the poses.
    fn add_sweep(
        &mut self,
        (incoming, kept): (&IncomingSweep, &KeptPoints),
        registered: &Registered,
        poses: &mut Vec<StampedPose>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        registered.counts().into_iter().for_each(|(name, n)| outputs.count(name, n));
        self.compare_inertial(registered);
        self.stretches.add(registered).into_iter().for_each(|text| outputs.note(text));
        outputs.count("points_out_of_range", kept.n_dropped as u64);
        let body_from_lidar = self.mounting.body_from_lidar;
        let world_from_body = |world_from_lidar: Pose| world_from_lidar * body_from_lidar.inverse();
        let (begin, end) = (world_from_body(registered.begin()), world_from_body(registered.end()));
        for (stamp, pose) in [(registered.stamp.0, begin), (registered.end_stamp().0, end)] {
            // Stamps on the topic never decrease, even if those of the recording do.
            if self.last_pose_stamp.is_none_or(|last| last <= stamp) {
                poses.push(StampedPose { stamp, world_from_body: pose.into() });
                self.last_pose_stamp = Some(stamp);
            } else {
                outputs.count("poses_out_of_order", 1);
            }
        }
        if self.open.as_ref().is_some_and(|open| !open.fits(kept.indices.len())) {
            self.close_submap(outputs)?;
        }
        let open = match &mut self.open {
            Some(open) => open,
            empty => {
                let loan = outputs.loan::<SubmapTopic>(self.settings.submap_points_max as usize)?;
                let open = empty.insert(LoanedSubmap::new(loan, &begin, incoming.received.header().n_rings));
                self.georeferencer.begin_submap(open.submap.frame.world_from_submap, registered.stamp.0);
                open
            }
        };
        self.georeferencer.add_sweep(registered, &begin, &end);
        open.append(incoming.rows(kept), registered, end.translation.vector)?;
        if open.submap.frame.path_m >= self.settings.submap_m || open.submap.seconds() >= self.settings.submap_s {
            self.close_submap(outputs)?;
        }
        Ok(())
    }

    /// Adds inertial samples that are not withheld.
    fn add_inertial(&mut self, rows: &[ImuRow]) {
        let mut samples: Vec<InertialSample> = rows.iter().map(InertialSample::from).collect();
        if self.settings.check_imu {
            samples = self.inertial.add_samples(&samples);
            self.forget_wrong_samples();
        }
        let rows: Vec<ImuRow> = samples.iter().map(ImuRow::from).collect();
        self.georeferencer.add_imu(&rows, &self.georeference);
        if self.settings.predicts_by("imu") {
            for sample in samples {
                self.odometry.add_imu(sample);
            }
        }
    }

    fn compare_inertial(&mut self, registered: &Registered) {
        if self.settings.check_imu {
            self.inertial.add_registered(registered, &self.mounting.body_from_lidar);
            self.forget_wrong_samples();
        }
    }

    fn forget_wrong_samples(&mut self) {
        if self.inertial.take_change() {
            self.odometry.forget_imu();
            self.georeferencer.forget_imu();
        }
    }

    fn report_inertial(&self, outputs: &mut Outputs) {
        self.inertial.summary().into_iter().for_each(|line| outputs.note(line));
        if let Some(text) = self.inertial.doubt() {
            outputs.doubt("imu_not_used", 1.0, text);
        }
    }

    fn prepare(&self, received: Received<SweepTopic>) -> (IncomingSweep, KeptPoints) {
        let incoming = IncomingSweep::new(received, &self.settings, &self.odometry);
        let kept = self.settings.kept_points(&incoming.sweep);
        (incoming, kept)
    }

    fn close_submap(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Some(open) = self.open.take() else { return Ok(()) };
        let is_loop = self.georeferencer.end_submap(&self.georeference, self.odometry.map());
        outputs.count("loops_found", u64::from(is_loop));
        open.publish(outputs)
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

    fn check(settings: &Settings, _context: &Context) -> Vec<Problem> {
        let is_cut = settings.imls_h_m > settings.imls_radius_m;
        let text = "must be at most imls_radius_m: the weights of the surface end at the radius";
        is_cut.then(|| Problem::of_key("imls_h_m", text)).into_iter().collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let manifest = match context.mode {
            Mode::Offline => Some(Drive::open(&context.drive).map_err(StepError::io)?.manifest().clone()),
            // The recording has only begun. Without a rig, body and LiDAR frame are the same.
            Mode::Live => LiveRig::find(&context.drive).map_err(StepError::io)?.manifest().cloned(),
        };
        let body_from_lidar = match &manifest {
            Some(manifest) => manifest.rig().map_err(StepError::data)?.body_from_lidar,
            None => Isometry3::identity(),
        };
        let georeference = settings.georeference(manifest.as_ref());
        let has_receiver =
            manifest.is_some_and(|manifest| manifest.gnss.is_some()) && context.is_connected::<GnssTopic>();
        let expects_fixes = has_receiver && georeference.gnss;
        Ok(Self { expects_fixes, ..Self::with_sensors(settings, body_from_lidar, georeference) })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.reopen_submap(outputs)?;
        for message in inputs.take::<ImuTopic>() {
            self.add_inertial(message.rows());
        }
        for message in inputs.take::<GnssTopic>() {
            let n_valid = self.georeferencer.add_gnss(message.rows(), &self.georeference);
            outputs.count("fixes", n_valid as u64);
            outputs.count("fixes_without_position", (message.rows().len() - n_valid) as u64);
            if self.settings.predicts_by("gnss") {
                let velocities = message.rows().iter().filter_map(GroundVelocity::of_fix);
                velocities.for_each(|velocity| self.odometry.add_gnss(velocity));
            }
        }
        let mut poses = Vec::new();
        for received in inputs.take::<SweepTopic>() {
            let incoming = IncomingSweep::new(received, &self.settings, &self.odometry);
            let (odometry, settings, sweep) = (&mut self.odometry, &self.settings, &incoming.sweep);
            let (registered, kept) = rayon::join(|| odometry.register(sweep), || settings.kept_points(sweep));
            let waiting = self.waiting.take().map(|received| self.prepare(received));
            let mut prepared = waiting.into_iter().chain([(incoming, kept)]);
            for (registered, (incoming, kept)) in registered.map_err(StepError::data)?.iter().zip(prepared.by_ref()) {
                self.add_sweep((&incoming, &kept), registered, &mut poses, outputs)?;
            }
            self.waiting = prepared.next().map(|(incoming, _)| incoming.received);
        }
        self.georeferencer.update(&self.georeference);
        publish_poses(&poses, outputs)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.reopen_submap(outputs)?;
        let mut poses = Vec::new();
        if let (Some(registered), Some(received)) = (self.odometry.finish(), self.waiting.take()) {
            let (incoming, kept) = self.prepare(received);
            self.add_sweep((&incoming, &kept), &registered, &mut poses, outputs)?;
        }
        publish_poses(&poses, outputs)?;
        let notes = self.odometry.turning_note().into_iter().chain(self.stretches.finish());
        notes.for_each(|text| outputs.note(text));
        self.close_submap(outputs)?;
        self.report_inertial(outputs);
        if let Some((seconds, text)) = self.stretches.contested(self.settings.max_contested_s) {
            outputs.doubt("motion_contested", seconds, text);
        }
        self.georeferencer.update(&self.georeference);
        let placed = self.georeferencer.solve(&self.georeference);
        if self.georeference.gnss {
            let counted = ["fixes", "fixes_without_position"].map(|name| outputs.counted(name));
            let min_used_share = self.settings.min_used_fixes_share;
            for doubt in FixDoubt::find(counted, self.expects_fixes, placed.as_ref(), min_used_share) {
                outputs.doubt(doubt.name(), doubt.size(), doubt.to_string());
            }
        }
        placed.map_or(Ok(()), |placed| publish_placement(&placed, outputs))
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let (submap, rows) = match (&self.open, &self.saved_submap) {
            (Some(open), _) => (Some(SubmapHead::of(open)), pod::bytes_from_rows(open.loan.rows())),
            (None, Some(saved)) => (Some(saved.head.clone()), &saved.rows[..]),
            (None, None) => (None, &[][..]),
        };
        let saving = Saved {
            odometry: self.odometry.save(),
            is_waiting: self.waiting.is_some(),
            submap,
            last_pose_stamp: self.last_pose_stamp,
            stretches: Cow::Borrowed(&self.stretches),
            inertial: Cow::Borrowed(&self.inertial),
            georeferencer: Cow::Borrowed(&self.georeferencer),
        };
        let mut state = StateBytes::with_head(STATE_VERSION, &saving)?;
        if let Some(waiting) = &self.waiting {
            state.push(waiting);
        }
        state.push_bytes(rows);
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let (saved, mut rest): (Saved<'_>, _) = decode_head(STATE_VERSION, state)?;
        let (settings, algorithm) = (self.settings.odometry(self.mounting), self.settings.algorithm());
        self.odometry = SelectedOdometry::load(settings, algorithm, saved.odometry).map_err(StepError::data)?;
        self.waiting = saved.is_waiting.then(|| next_message(&mut rest)).transpose()?;
        self.open = None;
        self.saved_submap = SavedSubmap::load(saved.submap, rest)?;
        self.last_pose_stamp = saved.last_pose_stamp;
        self.stretches = saved.stretches.into_owned();
        self.inertial = saved.inertial.into_owned();
        self.georeferencer = saved.georeferencer.into_owned();
        Ok(())
    }
}

fn publish_poses(poses: &[StampedPose], outputs: &mut Outputs) -> Result<(), StepError> {
    let Some(first) = poses.first() else { return Ok(()) };
    let mut loan = outputs.loan::<TrajectoryTopic>(poses.len())?;
    loan.extend_from_slice(poses)?;
    outputs.publish(loan, first.stamp)
}

fn publish_placement(placed: &Placed, outputs: &mut Outputs) -> Result<(), StepError> {
    outputs.note(&placed.summary);
    let mut loan = outputs.loan::<PlacementTopic>(placed.rows.len())?;
    *loan.header_mut() = placed.header;
    loan.extend_from_slice(&placed.rows)?;
    outputs.publish(loan, placed.rows.first().map_or(0, |row| row.stamp))
}
