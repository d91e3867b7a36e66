//! What can be set, and why the defaults are what they are.

stage::settings! {
    /// Settings of slam_aggregate.
    pub struct Settings {
        /// Length of a submap along the path, m: about two house fronts, a few million points at walking pace.
        pub submap_m: f64 = 20.0 => stage::within(1.0, 1000.0);
        /// Longest time of a submap, s: bounds the wait for results when the vehicle stands. Consumers keep the images
        /// of two such times, hence the upper limit.
        pub submap_s: f64 = 5.0 => stage::within(0.2, 10.0);
        /// Points of a submap at most; it is closed before the sweep that would not fit. 4 million are 112 MB and five
        /// seconds of 70 000 points at 10 Hz with a margin of 10 %.
        pub submap_points_max: u32 = 4_000_000 => stage::within(1_000, 20_000_000);
        /// Side of the cubes of which one point per sweep is kept, m; 0 keeps every return.
        pub thin_m: f64 = 0.0 => stage::within(0.0, 1.0);
        /// Nearer returns come from the vehicle itself or from drops and dust, m; they are dropped and counted.
        pub min_range_m: f64 = 1.0 => stage::within(0.0, 10.0);
        /// Farther points are kept but not used for registration, m. An HDL-32E reaches 100 m; on country roads what is far
        /// tells the way.
        pub max_range_m: f64 = 100.0 => stage::within(10.0, 250.0);
        /// Sweeps after which a point leaves the local map. 60 are 60 m at 10 m/s and 10 Hz, as far as surfaces are hit
        /// densely; more makes the map larger, less makes it forget a crossing while the vehicle turns.
        pub map_sweeps: u32 = 60 => stage::within(5, 1000);
        /// Points of the local map at most, the oldest leave first: bounds memory and saved state at 40 bytes each.
        pub map_points_max: u32 = 80_000 => stage::within(5_000, 1_000_000);
        /// Spacing of the local map's points, m: ten times the range noise. The search reaches 1.5 times as far, at
        /// most 0.5 m, hence the upper limit.
        pub map_spacing_m: f64 = 0.2 => stage::within(0.05, 0.33);
        /// What to make of sweeps without point times: "none" takes them as rigid, as those are whose motion has been
        /// compensated; "clockwise" and "counterclockwise" (seen from the sensor's top) give each point the time at which a
        /// sensor that turns evenly from behind to behind fires there.
        pub untimed_turn: String = "none".to_owned() => stage::one_of(&["none", "clockwise", "counterclockwise"]);
        /// Time of such a turn, s.
        pub untimed_turn_s: f64 = 0.1 => stage::within(0.02, 1.0);
        /// What foretells the motion from sweep to sweep, and is the motion where the scene does not determine it: inertial samples,
        /// speeds of a receiver. Without any the last motion goes on.
        pub motion: Vec<String> = ["imu", "gnss"].map(str::to_owned).to_vec() => stage::each_one_of(&["imu", "gnss"]);
        /// What the submaps' poses are corrected by at the end: fixes of a receiver, gravity as an inertial unit feels it, places
        /// that were passed twice. Without any the odometry stands as it is.
        pub correct: Vec<String> = ["gnss", "imu", "loops"].map(str::to_owned).to_vec() => stage::each_one_of(&["gnss", "imu", "loops"]);
        /// Planar points that are matched per sweep at most: 2000 average 3 cm of noise below 1 mm.
        pub matches_max: u32 = 2_000 => stage::within(200, 50_000);
    }
}
