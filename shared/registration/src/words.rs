//! Enumerated settings of the odometry.

settings::words! {
    /// Point times of sweeps without recorded times.
    pub enum UntimedTurn {
        /// Rigid sweeps until the spin direction is determined.
        Auto = "auto",
        /// Rigid sweeps.
        None = "none",
        /// Times of a sensor that spins evenly, clockwise seen from above.
        Clockwise = "clockwise",
        /// Times of a sensor that spins evenly, counterclockwise seen from above.
        Counterclockwise = "counterclockwise",
    }
}

settings::words! {
    /// Sensors that predict the motion between sweeps.
    pub enum MotionSensor {
        /// Inertial samples.
        Imu = "imu",
        /// GNSS velocities.
        Gnss = "gnss",
    }
}

settings::words! {
    /// Algorithms of the odometry.
    pub enum OdometryAlgorithm {
        /// [`Algorithm::ScanToMap`](crate::Algorithm::ScanToMap).
        ScanToMap = "scan_to_map",
        /// [`Algorithm::Imls`](crate::Algorithm::Imls).
        Imls = "imls",
    }
}
