//! The stage.

use crate::Settings;
use crate::drive_graph::{DriveGraph, Placed, Sensors};
use crate::odometry_settings::odometry_settings;
use crate::open_submap::OpenSubmap;
use crate::saved::{STATE_VERSION, Saved, SavedSubmap, SubmapHead};
use crate::sweeps::{Cloud, Scene};
use crate::weak_stretches::WeakStretches;
use formats::drive::Drive;
use formats::manifest::Manifest;
use geometry::{Geodetic, Isometry3, Point3, Pose, Stamp};
use messages::{Gnss, GnssRow, Imu, ImuRow, Placement, StampedPose, Submap, Sweep, Trajectory, pod};
use registration::{GroundVelocity, InertialSample, Odometry, Registered, SensorPlaces};
use stage::{
    Context, Flow, Inputs, Mode, Outputs, Port, Received, Stage, StateBytes, StepError, decode_head, next_message,
};

/// See the crate's page.
pub struct SlamAggregate {
    settings: Settings,
    body_from_lidar: Pose,
    sensors: Sensors,
    odometry: Odometry,
    /// The first sweep, until the second comes.
    waiting: Option<Received<Sweep>>,
    open: Option<OpenSubmap>,
    /// Loaded, and not yet in a slot.
    saved_submap: Option<SavedSubmap>,
    last_row_stamp: Option<i64>,
    weak: WeakStretches,
    graph: DriveGraph,
}

impl SlamAggregate {
    /// With a known mounting of the lidar; antenna and inertial unit at the body's origin.
    pub fn with_mounting(settings: &Settings, body_from_lidar: Pose) -> Self {
        Self::with_sensors(settings, body_from_lidar, sensors(settings, None))
    }

    fn with_sensors(settings: &Settings, body_from_lidar: Pose, sensors: Sensors) -> Self {
        let places = places(body_from_lidar, &sensors);
        Self {
            settings: settings.clone(),
            body_from_lidar,
            graph: DriveGraph::new(&sensors),
            sensors,
            // The body frame at the first shot is the world.
            odometry: Odometry::new(odometry_settings(settings, places), body_from_lidar),
            waiting: None,
            open: None,
            saved_submap: None,
            last_row_stamp: None,
            weak: WeakStretches::default(),
        }
    }

    /// Puts a registered sweep into the open submap, closes the submap where it is full, and appends the poses.
    fn place(
        &mut self,
        (cloud, scene): (&Cloud, &Scene),
        registered: &Registered,
        rows: &mut Vec<StampedPose>,
        outputs: &mut Outputs,
    ) -> Result<(), StepError> {
        count(registered, outputs);
        if let Some(text) = self.weak.see(registered) {
            outputs.note(text);
        }
        outputs.count("points_out_of_range", scene.n_dropped as u64);
        let body_from_lidar = self.body_from_lidar;
        let world_from_body = |world_from_lidar: Pose| world_from_lidar * body_from_lidar.inverse();
        let (begin, end) = (world_from_body(registered.begin()), world_from_body(registered.end()));
        let end_stamp = registered.stamp.0 + i64::from(registered.duration_nanos);
        for (stamp, pose) in [(registered.stamp.0, begin), (end_stamp, end)] {
            // Stamps on the topic never fall, whatever the recording's do.
            if self.last_row_stamp.is_none_or(|last| last <= stamp) {
                rows.push(StampedPose { stamp, world_from_body: pose.into() });
                self.last_row_stamp = Some(stamp);
            } else {
                outputs.count("poses_out_of_order", 1);
            }
        }
        if self.open.as_ref().is_some_and(|open| !open.fits(scene.kept.len())) {
            self.close(outputs)?;
        }
        let open = match &mut self.open {
            Some(open) => open,
            empty => {
                let loan = outputs.loan::<Submap>(self.settings.submap_points_max as usize)?;
                let open = empty.insert(OpenSubmap::new(loan, &begin, cloud.received.header().n_rings));
                self.graph.begin_submap(open.frame.world_from_submap, registered.stamp.0);
                open
            }
        };
        self.graph.add_sweep(registered, &begin, &end);
        open.append(cloud, scene, registered, end.translation.vector)?;
        if open.frame.travelled_m >= self.settings.submap_m || open.seconds() >= self.settings.submap_s {
            self.close(outputs)?;
        }
        Ok(())
    }

    fn prepared(&self, received: Received<Sweep>) -> (Cloud, Scene) {
        let cloud = Cloud::new(received, &self.settings);
        let scene = Scene::of(&cloud.sweep, &self.settings);
        (cloud, scene)
    }

    fn leans_on(&self, name: &str) -> bool {
        self.settings.motion.iter().any(|wanted| wanted == name)
    }

    fn close(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Some(open) = self.open.take() else { return Ok(()) };
        let is_loop = self.graph.end_submap(&self.sensors, self.odometry.map());
        outputs.count("loops_found", u64::from(is_loop));
        open.publish(outputs)
    }

    fn reopen(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
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
        vec![Port::of::<Sweep>(), Port::optional::<Gnss>(), Port::optional::<Imu>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Submap>(), Port::of::<Trajectory>(), Port::of::<Placement>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let manifest = match context.mode {
            Mode::Offline => Some(Drive::open(&context.drive).map_err(StepError::io)?.manifest().clone()),
            // The recording has only begun; where the vehicle's folder does not say otherwise, the frames are one.
            Mode::Live => Drive::rig_alone(&context.drive).map_err(StepError::io)?,
        };
        let body_from_lidar = match &manifest {
            Some(manifest) => manifest.rig().map_err(StepError::Data)?.body_from_lidar,
            None => Isometry3::identity(),
        };
        Ok(Self::with_sensors(settings, body_from_lidar, sensors(settings, manifest.as_ref())))
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.reopen(outputs)?;
        for message in inputs.take::<Imu>() {
            self.graph.push_inertial(message.rows());
            if self.leans_on("imu") {
                message.rows().iter().for_each(|row| self.odometry.feel(inertial_sample(row)));
            }
        }
        for message in inputs.take::<Gnss>() {
            let n_taken = self.graph.push_fixes(message.rows());
            outputs.count("fixes_without_position", (message.rows().len() - n_taken) as u64);
            if self.leans_on("gnss") {
                let velocities = message.rows().iter().filter_map(ground_velocity);
                velocities.for_each(|velocity| self.odometry.hear(velocity));
            }
        }
        let mut rows = Vec::new();
        for received in inputs.take::<Sweep>() {
            let cloud = Cloud::new(received, &self.settings);
            let (odometry, settings, sweep) = (&mut self.odometry, &self.settings, &cloud.sweep);
            let (registered, scene) = rayon::join(|| odometry.register(sweep), || Scene::of(sweep, settings));
            let registered = registered.map_err(StepError::data)?;
            let waiting = self.waiting.take().map(|received| self.prepared(received));
            let mut clouds = waiting.into_iter().chain([(cloud, scene)]);
            for (registered, (cloud, scene)) in registered.iter().zip(clouds.by_ref()) {
                self.place((&cloud, &scene), registered, &mut rows, outputs)?;
            }
            self.waiting = clouds.next().map(|(cloud, _)| cloud.received);
        }
        self.graph.settle(&self.sensors);
        publish_poses(&rows, outputs)?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.reopen(outputs)?;
        let mut rows = Vec::new();
        if let (Some(registered), Some(received)) = (self.odometry.finish(), self.waiting.take()) {
            let (cloud, scene) = self.prepared(received);
            self.place((&cloud, &scene), &registered, &mut rows, outputs)?;
        }
        publish_poses(&rows, outputs)?;
        if let Some(text) = self.weak.finish() {
            outputs.note(text);
        }
        self.close(outputs)?;
        self.graph.settle(&self.sensors);
        self.graph.place(&self.sensors).map_or(Ok(()), |placed| publish_placement(&placed, outputs))
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let (submap, rows) = match (&self.open, &self.saved_submap) {
            (Some(open), _) => (Some(SubmapHead::of(open)), pod::bytes_from_rows(open.loan.rows())),
            (None, Some(saved)) => (Some(saved.head.clone()), &saved.rows[..]),
            (None, None) => (None, &[][..]),
        };
        let saved = Saved {
            odometry: self.odometry.save(),
            waits: self.waiting.is_some(),
            submap,
            last_row_stamp: self.last_row_stamp,
            weak: self.weak.clone(),
            graph: self.graph.clone(),
        };
        let mut state = StateBytes::with_head(STATE_VERSION, &saved)?;
        if let Some(waiting) = &self.waiting {
            state.push(waiting);
        }
        state.push_bytes(rows);
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let (saved, mut rest): (Saved, _) = decode_head(STATE_VERSION, state)?;
        let places = places(self.body_from_lidar, &self.sensors);
        self.odometry = Odometry::load(odometry_settings(&self.settings, places), saved.odometry);
        self.waiting = saved.waits.then(|| next_message(&mut rest)).transpose()?;
        self.open = None;
        self.saved_submap = SavedSubmap::load(saved.submap, rest)?;
        self.last_row_stamp = saved.last_row_stamp;
        self.weak = saved.weak;
        self.graph = saved.graph;
        Ok(())
    }
}

fn count(registered: &Registered, outputs: &mut Outputs) {
    let weak = registered.matched.as_ref().is_some_and(|matched| matched.n_weak_directions > 0);
    outputs.count("sweeps_bridged", u64::from(registered.is_bridged()));
    outputs.count("degenerate_sweeps", u64::from(weak));
    outputs.count("maps_restarted", u64::from(registered.map_restarted));
    outputs.count("points_moving", registered.moving.len() as u64);
}

fn publish_poses(rows: &[StampedPose], outputs: &mut Outputs) -> Result<(), StepError> {
    let Some(first) = rows.first() else { return Ok(()) };
    let mut loan = outputs.loan::<Trajectory>(rows.len())?;
    let too_small = || StepError::Contract(format!("a loan for {} poses does not hold them", rows.len()));
    loan.extend_from_slice(rows).ok_or_else(too_small)?;
    outputs.publish(loan, first.stamp)
}

fn places(body_from_lidar: Pose, sensors: &Sensors) -> SensorPlaces {
    SensorPlaces { body_from_lidar, imu_in_body: sensors.imu_in_body, antenna_in_body: sensors.antenna_in_body }
}

fn inertial_sample(row: &ImuRow) -> InertialSample {
    InertialSample { stamp: Stamp(row.stamp), force: row.acceleration.into(), rate: row.angular_rate.into() }
}

/// `None` where the receiver does not tell how fast it moves.
fn ground_velocity(row: &GnssRow) -> Option<GroundVelocity> {
    let told = |value: f64| (value >= 0.0).then_some(value);
    let hdop = Some(f64::from(row.hdop)).filter(|hdop| *hdop > 0.0);
    GroundVelocity::new(Stamp(row.stamp), told(row.speed_mps)?, told(row.course_deg), hdop)
}

/// What the settings want of what a drive has.
fn sensors(settings: &Settings, manifest: Option<&Manifest>) -> Sensors {
    let is_wanted = |name: &str| settings.correct.iter().any(|wanted| wanted == name);
    let gnss = manifest.and_then(|manifest| manifest.gnss.as_ref());
    let imu = manifest.and_then(|manifest| manifest.imu.as_ref());
    Sensors {
        gnss: is_wanted("gnss"),
        imu: is_wanted("imu"),
        loops: is_wanted("loops"),
        antenna_in_body: gnss.map_or_else(Point3::origin, |gnss| gnss.antenna_in_body.into()),
        imu_in_body: imu.map_or_else(Point3::origin, |imu| imu.position_in_body.into()),
        origin: gnss.and_then(|gnss| Geodetic::new(gnss.origin[0], gnss.origin[1], gnss.origin[2])),
    }
}

fn publish_placement(placed: &Placed, outputs: &mut Outputs) -> Result<(), StepError> {
    outputs.note(&placed.words);
    let mut loan = outputs.loan::<Placement>(placed.rows.len())?;
    *loan.header_mut() = placed.header;
    let too_small = || StepError::Contract(format!("a loan for {} submaps does not hold them", placed.rows.len()));
    loan.extend_from_slice(&placed.rows).ok_or_else(too_small)?;
    outputs.publish(loan, placed.rows.first().map_or(0, |row| row.stamp))
}
