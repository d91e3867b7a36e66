//! Settings of the stage, and the derived settings of its libraries.

use drive::manifest::Manifest;
use geometry::{Geodetic, Point3};
use georeference::{Correction, GeoreferenceSettings, InertialUnit, PathSource};
use messages::{Message, SubmapTopic};
use registration::{
    Algorithm, ImlsSettings, InertialCheck, KeptPoints, MotionSensor, OdometryAlgorithm, OdometrySettings, Revolution,
    Sampling, SensorMounting, SpinDirection, Sweep, UntimedTurn,
};
use stage::{Word, list_of_words, one_word};

stage::settings! {
    /// Settings of slam_aggregate.
    pub struct Settings {
        /// Source of the path. "odometry": LiDAR odometry; the path of `[trajectory]` in drive.toml is only compared.
        /// "given": the path of `[trajectory]`, without matching. "refined": LiDAR odometry, with the path of
        /// `[trajectory]` as a measurement instead of the fixes.
        pub path: PathSource = PathSource::Odometry => one_word();
        /// Compare the path of `[trajectory]` with the inertial unit, the fixes and its own direction of travel before the start,
        /// and refuse it if it contradicts them. false uses it as it is.
        pub check_path: bool = true => stage::any();
        /// Length of a submap along the path, m. 20 m are about two house fronts and a few million points at walking pace.
        pub submap_m: f64 = 20.0 => stage::within(1.0, 1000.0);
        /// Longest time of a submap, s. It limits the latency while the vehicle stands. Consumers keep the images of
        /// two such times, hence the upper limit.
        pub submap_s: f64 = 5.0 => stage::within(0.2, 10.0);
        /// Largest number of points of a submap. The submap is closed before the sweep that does not fit. 4 million are 112 MB
        /// and five seconds of 70 000 points at 10 Hz with a margin of 10 %. A message has at most
        /// 8 388 608 points, hence the upper limit.
        pub submap_points_max: u32 = 4_000_000 => stage::within(1_000, SubmapTopic::MAX_ROWS as u32);
        /// Side of the voxels in which one point per sweep is kept, m; 0 keeps every return.
        pub thin_m: f64 = 0.0 => stage::within(0.0, 1.0);
        /// Closer returns are dropped and counted, m: they come from the vehicle itself, rain or dust.
        pub min_range_m: f64 = 1.0 => stage::within(0.0, 10.0);
        /// Farther points are kept but not used for registration, m. 100 m is the range of an HDL-32E; on country roads the far
        /// points determine the position along the road.
        pub max_range_m: f64 = 100.0 => stage::within(10.0, 250.0);
        /// Sweeps after which a point is dropped from the local map. 60 are 60 m at 10 m/s and 10 Hz, the range of dense returns.
        /// A larger map costs memory and time; a smaller one loses the surroundings while the vehicle turns at a crossing.
        pub map_sweeps: u32 = 60 => stage::within(5, 1000);
        /// Largest number of points in the local map; the oldest are dropped first. It limits memory and saved state to
        /// 40 bytes a point.
        pub map_points_max: u32 = 80_000 => stage::within(5_000, 1_000_000);
        /// Spacing of the local map's points, m: ten times the range noise. The search radius is 1.5 times as large and at most
        /// 0.5 m, hence the upper limit.
        pub map_spacing_m: f64 = 0.2 => stage::within(0.05, 0.33);
        /// Point times for sweeps that lack them. "clockwise" and "counterclockwise" (seen from above): times of a
        /// sensor that spins evenly from rear to rear. "none": the sweeps are rigid, as after deskewing. "auto": rigid
        /// until the sweeps show which of the three applies. The stamp of such a sweep is the middle of its revolution,
        /// when the sensor faces ahead.
        pub untimed_turn: UntimedTurn = UntimedTurn::Auto => one_word();
        /// Time of one revolution of such a sensor, s; with "auto" at most the time between two sweeps.
        pub untimed_turn_s: f64 = 0.1 => stage::within(0.02, 1.0);
        /// Sensors used to predict the motion between sweeps: inertial samples, GNSS velocities. Along degenerate directions the
        /// prediction is used as is. Without sensors the previous motion continues.
        pub motion: Vec<MotionSensor> = MotionSensor::ALL.to_vec() => list_of_words();
        /// Compare the inertial unit with the motion of the LiDAR: wrong units, axes and times are corrected, and a unit that does not
        /// fit is not used. false uses the samples as they are.
        pub check_imu: bool = true => stage::any();
        /// Give the samples of the inertial unit no weight in matches until they agree with the LiDAR, which takes some
        /// seconds of turns and braking. It protects against mirrored or late units, which otherwise disturb the poses
        /// that they are compared with. Degenerate directions and sweeps without a match follow the samples from the start.
        pub imu_probation: bool = true => stage::any();
        /// Measurements that correct the poses of the submaps at the end: GNSS fixes, gravity by the inertial unit, loop closures.
        /// Without any the odometry is the result.
        pub correct: Vec<Correction> = Correction::ALL.to_vec() => list_of_words();
        /// Seconds during which surrounding traffic may make the ego-motion ambiguous; beyond it, the result is
        /// doubtful. Stretches are a second or longer.
        pub max_contested_s: f64 = 0.0 => stage::within(0.0, 1e6);
        /// Largest growth of the path's deviation where geometry is degenerate, m; beyond it, the result is doubtful.
        /// Heading error is converted to metres at a 50 m lever arm. Results that are placed by fixes have their own
        /// limits in export.
        pub max_lost_m: f64 = 5.0 => stage::within(0.0, 1e6);
        /// Seconds of the drive without matches that support the path; beyond it, the result is doubtful. Stretches have
        /// at least 5 sweeps without a match among 10. A drive without any match is always doubtful.
        pub max_unmatched_s: f64 = 0.0 => stage::within(0.0, 1e6);
        /// Share of the fixes that must agree with the result; below it, the result is doubtful. If more than half of
        /// the fixes are rejected, the rejected ones may be the correct ones. 0 accepts a drive whose fixes are not
        /// used at all.
        pub min_used_fixes_share: f64 = 0.5 => stage::within(0.0, 1.0);
        /// Largest number of places kept for loop closures; the oldest are dropped first. 1000 are 20 km of streets in submaps of
        /// 20 m, and at most 80 MB of memory and of each saved state. A place that is visited again counts once.
        pub loop_places_max: u32 = 1_000 => stage::within(10, 100_000);
        /// Invert the smoothing filter of the GNSS receiver where its fixes show one. Only the simulated receiver is
        /// known to have such a filter; set it when the log of a real receiver also shows one.
        pub unsmooth_fixes: bool = false => stage::any();
        /// Largest number of planar points that are matched per sweep: 2000 average 3 cm of noise below 1 mm.
        pub matches_max: u32 = 2_000 => stage::within(200, 50_000);
        /// Algorithm of the odometry. "scan_to_map": thinned map, estimated motion during the sweep, all sensors of
        /// `motion`. "imls": IMLS-SLAM as published (Deschaud, ICRA 2018), with the LiDAR alone, for comparison; it
        /// takes about ten times the computing time, and 72 MB in each saved state.
        pub odometry: OdometryAlgorithm = OdometryAlgorithm::ScanToMap => one_word();
        /// IMLS-SLAM: samples of each of the nine observability lists. The paper's s is 100.
        pub imls_samples: u32 = 100 => stage::within(10, 10_000);
        /// IMLS-SLAM: width of the Gaussian weights of the surface, m. The paper's h is 0.06; it must not be below the spacing of
        /// the points.
        pub imls_h_m: f64 = 0.06 => stage::within(0.02, 0.5);
        /// IMLS-SLAM: largest distance of a sample from the model, and radius of the surface, m. The paper's r is 0.2, about three
        /// times h.
        pub imls_radius_m: f64 = 0.2 => stage::within(0.05, 0.5);
        /// IMLS-SLAM: iterations of a match. The paper always uses 20.
        pub imls_rounds: u32 = 20 => stage::within(1, 200);
        /// IMLS-SLAM: sweeps in the model, with all their points. The paper's n is 100. Memory and saved state are about 0.7 MB a
        /// sweep of 60 000 points.
        pub imls_sweeps: u32 = 100 => stage::within(1, 1000);
    }
}

impl Settings {
    /// Whether a sensor predicts the motion.
    pub(crate) fn predicts_by(&self, sensor: MotionSensor) -> bool {
        self.motion.contains(&sensor)
    }

    pub(crate) fn inertial_unit(&self, mounting: &SensorMounting) -> InertialUnit {
        let check = self.check_imu.then(|| InertialCheck::new(mounting.imu_in_body, self.imu_probation));
        InertialUnit::new(check, self.predicts_by(MotionSensor::Imu))
    }

    /// The points of a sweep that go into the submap.
    pub(crate) fn kept_points(&self, sweep: &Sweep) -> KeptPoints {
        KeptPoints::select(sweep, self.min_range_m, self.thin_m)
    }

    /// The revolution of a sensor without point times. `found`: by the odometry.
    pub(crate) fn untimed_turn(&self, found: Option<Revolution>) -> Option<Revolution> {
        let spin = match self.untimed_turn {
            UntimedTurn::Clockwise => SpinDirection::Clockwise,
            UntimedTurn::Counterclockwise => SpinDirection::Counterclockwise,
            // With "none" the odometry does not search for it.
            UntimedTurn::Auto | UntimedTurn::None => return found,
        };
        Some(Revolution { spin, duration_nanos: (self.untimed_turn_s * 1e9) as u32 })
    }

    pub(crate) fn algorithm(&self) -> Algorithm {
        match self.odometry {
            OdometryAlgorithm::Imls => Algorithm::Imls(ImlsSettings {
                per_list: self.imls_samples as usize,
                h_m: self.imls_h_m,
                radius_m: self.imls_radius_m,
                rounds: self.imls_rounds,
                sweeps: self.imls_sweeps,
            }),
            OdometryAlgorithm::ScanToMap => Algorithm::ScanToMap,
        }
    }

    pub(crate) fn odometry(&self, mounting: SensorMounting) -> OdometrySettings {
        let odometry = OdometrySettings { mounting, ..OdometrySettings::default() };
        let mut odometry = odometry.with_map_spacing(self.map_spacing_m);
        odometry.features.min_range_m = odometry.features.min_range_m.max(self.min_range_m as f32);
        odometry.features.max_range_m = self.max_range_m as f32;
        odometry.untimed_turn_s = (self.untimed_turn == UntimedTurn::Auto).then_some(self.untimed_turn_s);
        odometry.map.batches = self.map_sweeps;
        odometry.map.max_points = self.map_points_max as usize;
        if let Sampling::Even { max_features, .. } = &mut odometry.matching.sampling {
            *max_features = self.matches_max as usize;
        }
        odometry
    }

    /// Settings of the georeference. Without a manifest, antenna and inertial unit are at the body's origin.
    pub(crate) fn georeference(&self, manifest: Option<&Manifest>) -> GeoreferenceSettings {
        // A given path contains the fixes; poses that are given are not corrected.
        let uses = |measurement: Correction| {
            let is_replaced =
                self.path == PathSource::Given || (self.path == PathSource::Refined && measurement == Correction::Gnss);
            !is_replaced && self.correct.contains(&measurement)
        };
        let gnss = manifest.and_then(|manifest| manifest.gnss.as_ref());
        let imu = manifest.and_then(|manifest| manifest.imu.as_ref());
        GeoreferenceSettings {
            gnss: uses(Correction::Gnss),
            imu: uses(Correction::Imu),
            loops: uses(Correction::Loops),
            unsmooth_fixes: self.unsmooth_fixes,
            max_keyframes: self.loop_places_max as usize,
            antenna_in_body: gnss.map_or_else(Point3::origin, |gnss| gnss.antenna_in_body.into()),
            imu_in_body: imu.map_or_else(Point3::origin, |imu| imu.mounting().translation.vector.into()),
            origin: gnss.and_then(|gnss| Geodetic::new(gnss.origin[0], gnss.origin[1], gnss.origin[2])),
        }
    }
}
