//! Words of settings for the georeference.

settings::words! {
    /// Measurements that correct the poses of the submaps.
    pub enum Correction {
        /// GNSS fixes.
        Gnss = "gnss",
        /// Gravity by the inertial unit.
        Imu = "imu",
        /// Loop closures.
        Loops = "loops",
    }
}
