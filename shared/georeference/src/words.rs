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
