//! Settings of export.

stage::settings! {
    /// Settings of export.
    pub struct Settings {
        /// File formats of the clouds.
        pub formats: Vec<String> = vec!["ply".to_owned()] => stage::each_one_of(&["ply"]);
        /// Frame of the clouds: world (local east-north-up if the drive has GNSS, corrected at the end of the drive), odom
        /// (frame of the odometry, never corrected), utm (easting and northing; needs coordinates = "double").
        pub frame: String = "world".to_owned() => stage::one_of(&["world", "odom", "utm"]);
        /// Type of the coordinates in clouds. float resolves 1 mm up to 8 km from the origin.
        pub coordinates: String = "float".to_owned() => stage::one_of(&["float", "double"]);
        /// Whether a separate cloud with the spectra is written for each submap.
        pub spectra: bool = true => stage::any();
        /// File formats of the trajectory.
        pub trajectory: Vec<String> = vec!["tum".to_owned()] => stage::each_one_of(&["tum", "kitti", "csv"]);
    }
}
