//! Enumerated settings of the georeferencing.

settings::words! {
    /// Measurements that correct the poses of the submaps.
    pub enum Correction {
        /// GNSS fixes.
        Gnss = "gnss",
        /// Gravity from the inertial unit.
        Imu = "imu",
        /// Loop closures.
        Loops = "loops",
    }
}

settings::words! {
    /// Sources of the path of the vehicle.
    pub enum PathSource {
        /// Odometry and measurements; a given path is compared.
        Odometry = "odometry",
        /// The given path.
        Given = "given",
        /// Odometry, with the given path as a measurement.
        Refined = "refined",
    }
}
