//! One pass over a drive: the motion from the LiDAR alone, and all data that the checks compare with it.

mod edges;
mod ground;
mod images;
mod kept;
mod stamps;

pub use edges::SweepEdges;
pub use ground::{GroundPlane, ground_plane};
pub use images::{PixelBuffer, decoded};
pub use kept::KeptSweep;
pub use stamps::{SensorKind, SensorStamps};

use stamps::stamps_of;

use crate::error::RigError;
use acquisition::rows::sweep_header;
use drive::Drive;
use drive::imu::ImuSample;
use geometry::{Isometry3, Pose, Stamp, Trajectory, UnitQuaternion, Vector3};
use kept::Wanted;
use lidar::SweepInfo;
use lidar::nmea::Fix;
use messages::{ImuRow, SweepHeader, SweepPoint};
use registration::{
    FeatureSettings, InertialCheck, InertialSample, Odometry, OdometrySettings, Registered, Revolution, RingError,
    SensorMounting, SpinDirection, Sweep, planar_features,
};

/// The part of a drive that is surveyed.
#[derive(Clone, Copy, Debug)]
pub struct SurveySettings {
    /// Start, s after the first sweep.
    pub start_s: f64,
    /// Largest length, s.
    pub seconds: f64,
    /// Spin direction of a sensor without point times, as in the setting `untimed_turn` of `slam_aggregate`; `None`:
    /// rigid sweeps.
    pub untimed_turn: Option<SpinDirection>,
}

impl Default for SurveySettings {
    /// A minute contains turns and braking in most streets.
    fn default() -> Self {
        Self { start_s: 0.0, seconds: 60.0, untimed_turn: None }
    }
}

/// Least share of a revolution, as in `acquire`.
const MIN_TURN: f64 = 0.5;
/// The ground is searched in one of this many sweeps.
const GROUND_EVERY: usize = 5;
/// Share of sweeps without a match from which other directions of the vehicle are tried.
const MAX_BRIDGED: f64 = 0.3;
/// Number of sweeps of a trial.
const TRIAL_SWEEPS: usize = 30;
/// Sweeps that are kept as received, for the check of the spin.
const STRETCH_SWEEPS: usize = 24;
/// Least displacement from sweep to sweep at which the stretch begins, m.
const STRETCH_STEP_M: f64 = 0.3;

/// A registered sweep.
#[derive(Clone, Debug)]
pub struct SweepPose {
    /// Time of the middle of the sweep.
    pub middle: Stamp,
    /// `odom_from_body` at that time.
    pub odom_from_body: Pose,
    /// Whether the pose is a match without degenerate directions.
    pub is_measured: bool,
}

/// A sweep as it was received.
#[derive(Clone, Debug)]
pub struct RawSweep {
    /// First shot.
    pub stamp: Stamp,
    /// Data of the whole sweep.
    pub header: SweepHeader,
    /// Points of the sweep.
    pub rows: Vec<SweepPoint>,
}

impl RawSweep {
    /// The sweep as a message of topic `sweep`.
    pub(crate) fn view(&self) -> registration::RawSweep<'_> {
        registration::RawSweep { seq: 0, stamp: self.stamp, header: &self.header, rows: &self.rows }
    }
}

/// Measurements of one pass over a drive.
pub struct Survey {
    /// First shot and last shot.
    pub span: [Stamp; 2],
    /// Registered sweeps.
    pub poses: Vec<SweepPose>,
    /// `odom_from_body` at the first and last shots.
    pub trajectory: Trajectory,
    /// Outlines of objects.
    pub edges: Vec<SweepEdges>,
    /// The ground in some of the sweeps, LiDAR frame.
    pub ground: Vec<GroundPlane>,
    /// Sweeps in which the ground was searched.
    pub n_ground_searches: usize,
    /// Comparison of the inertial unit with the poses; `None` without a unit.
    pub inertial: Option<InertialCheck>,
    /// Samples within the span, along the body axes stated by `drive.toml`.
    pub samples: Vec<ImuRow>,
    /// All fixes of the receiver.
    pub fixes: Vec<Fix>,
    /// Errors of the rings.
    pub ring_errors: Vec<RingError>,
    /// Sweeps for pictures.
    pub kept: Vec<KeptSweep>,
    /// Consecutive sweeps of the moving vehicle, as received.
    pub stretch: Vec<RawSweep>,
    /// Whether the points have times, measured or from the setting.
    pub has_times: bool,
    /// Stamps of all sensors.
    pub stamps: Vec<SensorStamps>,
}

impl Survey {
    /// Reads a drive.
    pub fn from_drive(drive: &Drive, settings: &SurveySettings) -> Result<Self, RigError> {
        let mut pass = Pass::begin(drive, settings, 0.0)?;
        pass.run(usize::MAX)?;
        if pass.bridged_share() > MAX_BRIDGED {
            // The first of equal shares, which is the stated mounting.
            let mut best_yaw_deg = 0.0;
            let mut least_share = f64::INFINITY;
            for yaw_deg in [0.0, 90.0, 180.0, 270.0_f64] {
                let mut trial = Pass::begin(drive, settings, yaw_deg.to_radians())?;
                trial.run(TRIAL_SWEEPS)?;
                let share = trial.bridged_share();
                if share < least_share {
                    least_share = share;
                    best_yaw_deg = yaw_deg;
                }
            }
            if best_yaw_deg != 0.0 {
                pass = Pass::begin(drive, settings, best_yaw_deg.to_radians())?;
                pass.run(usize::MAX)?;
            }
        }
        pass.finish()
    }

    /// Share of the sweeps without a match.
    pub fn bridged_share(&self) -> f64 {
        let n_bridged = self.poses.iter().filter(|pose| !pose.is_measured).count();
        n_bridged as f64 / self.poses.len().max(1) as f64
    }
}

/// A pass in progress.
struct Pass<'a> {
    drive: &'a Drive,
    settings: &'a SurveySettings,
    body_from_lidar: Pose,
    up_in_lidar: Vector3<f32>,
    source: drive::SweepSource,
    odometry: Odometry,
    imu: Option<ImuFeed>,
    waiting: Option<RawSweep>,
    wanted: Wanted,
    found: Survey,
    n_sweeps: usize,
}

impl<'a> Pass<'a> {
    /// `yaw`: the assumed direction of the vehicle about the z axis of the body, rad.
    fn begin(drive: &'a Drive, settings: &'a SurveySettings, yaw: f64) -> Result<Self, RigError> {
        let body_from_lidar = drive.rig().body_from_lidar;
        let mounting = SensorMounting { body_from_lidar, ..SensorMounting::default() };
        let odometry_settings = OdometrySettings { mounting, ..OdometrySettings::default() };
        let turned = Isometry3::from_parts(
            geometry::Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
        );
        let imu = ImuFeed::open(drive)?;
        let (mut fixes, _) = drive.fixes().map_err(|error| RigError::log(drive, &error))?;
        fixes.retain(|fix| fix.position_deg.iter().all(|v| v.is_finite()));
        let found = Survey {
            span: [Stamp(0); 2],
            poses: Vec::new(),
            trajectory: Trajectory::default(),
            edges: Vec::new(),
            ground: Vec::new(),
            n_ground_searches: 0,
            inertial: imu.as_ref().map(|feed| InertialCheck::new(feed.position_in_body, true)),
            samples: Vec::new(),
            fixes,
            ring_errors: Vec::new(),
            kept: Vec::new(),
            stretch: Vec::new(),
            has_times: false,
            stamps: Vec::new(),
        };
        Ok(Self {
            drive,
            settings,
            body_from_lidar,
            up_in_lidar: (body_from_lidar.rotation.inverse() * Vector3::z()).cast(),
            source: drive.sweeps()?,
            odometry: Odometry::new(odometry_settings, turned * body_from_lidar),
            imu,
            waiting: None,
            wanted: Wanted::default(),
            found,
            n_sweeps: 0,
        })
    }

    fn bridged_share(&self) -> f64 {
        self.found.bridged_share()
    }

    /// Registers sweeps up to the end of the part, at most `max_sweeps`.
    fn run(&mut self, max_sweeps: usize) -> Result<(), RigError> {
        let mut first = None;
        while self.n_sweeps < max_sweeps {
            let mut rows = Vec::new();
            let Some(info) = self.source.next_sweep(|points| rows.extend_from_slice(points))? else { break };
            let begin = *first.get_or_insert(info.stamp);
            let seconds = info.stamp.seconds_since(begin);
            if seconds >= self.settings.start_s + self.settings.seconds {
                break;
            }
            if seconds >= self.settings.start_s && info.turn >= MIN_TURN {
                self.add(&info, rows);
            }
        }
        Ok(())
    }

    fn add(&mut self, info: &SweepInfo, rows: Vec<SweepPoint>) {
        let raw = RawSweep { stamp: info.stamp, header: sweep_header(info, self.drive.lidar().n_rings()), rows };
        if self.n_sweeps == 0 {
            self.found.span[0] = raw.stamp;
            self.wanted = Wanted::new(self.drive, raw.stamp, self.settings.seconds);
        }
        let end = raw.stamp.plus_nanos(i64::from(info.duration_nanos));
        self.found.span[1] = end;
        self.n_sweeps += 1;
        let sweep = self.sweep(&raw);
        self.found.has_times = sweep.duration_nanos() > 0;
        self.add_samples(end);
        self.search_ground(&sweep);
        // A sweep out of time order cannot be registered; the pipeline reports its stamp.
        let Ok(registered) = self.odometry.register(&sweep) else { return };
        let waiting = self.waiting.take();
        let mut raws = waiting.into_iter().chain([raw]);
        for (registered, raw) in registered.iter().zip(raws.by_ref()) {
            self.add_registered(registered, raw);
        }
        self.waiting = raws.next();
    }

    fn sweep(&self, raw: &RawSweep) -> Sweep {
        let revolution = |spin| Revolution { spin, duration_nanos: raw.header.duration_nanos };
        let untimed = self.settings.untimed_turn.map(revolution);
        Sweep::from_rows(raw.stamp, &raw.header, &raw.rows, untimed)
    }

    fn add_samples(&mut self, end: Stamp) {
        let Some(feed) = &mut self.imu else { return };
        let rows = feed.before(self.found.span[0], end);
        if let Some(check) = &mut self.found.inertial {
            let samples: Vec<InertialSample> = rows.iter().map(InertialSample::from).collect();
            check.add_samples(&samples);
        }
        self.found.samples.extend(rows);
    }

    fn search_ground(&mut self, sweep: &Sweep) {
        if self.n_sweeps % GROUND_EVERY == 1 {
            let settings = FeatureSettings { spacing_m: 0.4, max_range_m: 30.0, ..FeatureSettings::default() };
            let features = planar_features(sweep, &self.up_in_lidar, &settings);
            self.found.n_ground_searches += 1;
            self.found.ground.extend(ground_plane(&features, &self.up_in_lidar));
        }
    }

    fn add_registered(&mut self, registered: &Registered, raw: RawSweep) {
        if let Some(check) = &mut self.found.inertial {
            check.add_registered(registered, &self.body_from_lidar);
            // The survey does not use the samples.
            check.take_change();
        }
        let body = |odom_from_lidar: Pose| odom_from_lidar * self.body_from_lidar.inverse();
        let begin = body(registered.begin());
        let end = body(registered.end());
        self.found.trajectory.push(registered.stamp, begin);
        self.found.trajectory.push(registered.end_stamp(), end);
        let matched = registered.matched.as_ref();
        self.found.poses.push(SweepPose {
            middle: registered.stamp.plus_nanos(i64::from(registered.duration_nanos) / 2),
            odom_from_body: body(registered.motion.mid),
            is_measured: matched.is_some_and(|matched| matched.n_degenerate_directions == 0),
        });
        let sweep = self.sweep(&raw);
        if !self.drive.rig().cameras.is_empty() {
            self.found.edges.extend(SweepEdges::from_sweep(&raw, &sweep, registered, &begin));
        }
        if let Some(kept) = self.wanted.keep(&raw, registered) {
            self.found.kept.push(kept);
        }
        let step_m = (end.translation.vector - begin.translation.vector).norm();
        let is_moving = step_m > STRETCH_STEP_M || self.moves_from_before();
        let stretch = &mut self.found.stretch;
        if stretch.len() < STRETCH_SWEEPS && (!stretch.is_empty() || is_moving) {
            stretch.push(raw);
        }
    }

    /// Whether the vehicle moved between the last two poses: sweeps without times have no motion of their own.
    fn moves_from_before(&self) -> bool {
        let [.., a, b] = &self.found.poses[..] else { return false };
        (b.odom_from_body.translation.vector - a.odom_from_body.translation.vector).norm() > STRETCH_STEP_M
    }

    fn finish(mut self) -> Result<Survey, RigError> {
        if let (Some(registered), Some(raw)) = (self.odometry.finish(), self.waiting.take()) {
            self.add_registered(&registered, raw);
        }
        if self.found.poses.is_empty() {
            return Err(RigError::NoSweep { folder: self.drive.folder().to_owned() });
        }
        self.found.ring_errors = self.odometry.ring_errors();
        if self.drive.manifest().gnss.is_none() {
            self.found.fixes = self.source.take_fixes();
        }
        self.found.stamps = stamps_of(self.drive, self.found.span, &self.found.fixes, self.n_sweeps)?;
        Ok(self.found)
    }
}

/// The samples of the inertial unit with a look-ahead of one.
struct ImuFeed {
    reader: drive::imu::ImuReader<std::io::BufReader<std::fs::File>>,
    ahead: Option<ImuSample>,
    position_in_body: geometry::Point3<f64>,
}

impl ImuFeed {
    fn open(drive: &Drive) -> Result<Option<Self>, RigError> {
        let entry = drive.manifest().imu.as_ref();
        let reader = drive.imu().map_err(|error| RigError::log(drive, &error))?;
        Ok(reader.zip(entry).map(|(reader, entry)| {
            let position_in_body = entry.mounting().translation.vector.into();
            let mut feed = Self { reader, ahead: None, position_in_body };
            feed.advance();
            feed
        }))
    }

    /// The samples from `begin` to `end`.
    fn before(&mut self, begin: Stamp, end: Stamp) -> Vec<ImuRow> {
        let mut rows = Vec::new();
        while let Some(sample) = self.ahead.filter(|sample| sample.stamp < end) {
            if sample.stamp >= begin {
                let ImuSample { stamp, acceleration, angular_rate } = sample;
                rows.push(ImuRow { stamp: stamp.0, acceleration, angular_rate });
            }
            self.advance();
        }
        rows
    }

    /// Bad lines are skipped: `acquire` counts them.
    fn advance(&mut self) {
        self.ahead = self.reader.by_ref().flatten().next();
    }
}
