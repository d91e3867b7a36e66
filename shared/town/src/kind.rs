//! Kinds of towns, and densities of their traffic.

settings::words! {
    /// The kind of town.
    pub enum Town {
        /// Blocks of houses, squares and parks; a round of 1.5 km.
        Urban = "urban",
        /// Houses in gardens along curved roads; a round of 1.5 km.
        Suburban = "suburban",
        /// A country road with village, fields, forest, tunnel, level crossing, canal and farms.
        Rural = "rural",
        /// A country road through open fields: degenerate geometry for odometry.
        Field = "field",
        /// A country road through tunnels of 110 m or more; the drive starts before the first one.
        Tunnel = "tunnel",
        /// A motorway with two or three lanes each way: guard rails, verges, noise walls, gantries.
        Motorway = "motorway",
    }
}

impl Town {
    /// Speed of the ego vehicle without obstacles, m/s.
    pub const fn cruise_mps(self) -> f64 {
        match self {
            Self::Urban | Self::Suburban => 9.0,
            Self::Rural | Self::Field | Self::Tunnel => 11.5,
            Self::Motorway => 24.0,
        }
    }
}

settings::words! {
    /// Density of the traffic.
    #[derive(Default)]
    pub enum Traffic {
        /// A leading vehicle, a few following vehicles, and oncoming traffic.
        #[default]
        Normal = "normal",
        /// A one-way street full of vehicles that stop and start with the ego vehicle, which has a bus next to it.
        Dense = "dense",
    }
}
