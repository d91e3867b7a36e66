//! The kinds of towns and of their traffic.

/// The kind of town.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Town {
    /// Blocks of houses, squares and parks; crossings with lights.
    Urban,
    /// Houses in gardens along curved roads.
    Suburban,
    /// A country road: village, fields, forest, tunnel, level crossing, canal, farms.
    Rural,
    /// The same road between open fields: nothing stands near it but at its village.
    Field,
    /// The same road through tunnels; the drive begins before the first one.
    Tunnel,
    /// A motorway: two or three lanes each way between guard rails, verges, noise walls and berms.
    Motorway,
}

impl Town {
    /// All kinds.
    pub const ALL: [Self; 6] = [Self::Urban, Self::Suburban, Self::Rural, Self::Field, Self::Tunnel, Self::Motorway];

    /// Name in launch files and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Urban => "urban",
            Self::Suburban => "suburban",
            Self::Rural => "rural",
            Self::Field => "field",
            Self::Tunnel => "tunnel",
            Self::Motorway => "motorway",
        }
    }

    /// Speed of the ego vehicle where nothing keeps it from it, m/s.
    pub const fn cruise_mps(self) -> f64 {
        match self {
            Self::Urban | Self::Suburban => 9.0,
            Self::Rural | Self::Field | Self::Tunnel => 11.5,
            Self::Motorway => 24.0,
        }
    }

    /// One line about the town, for help texts.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Urban => "blocks of houses, squares and parks; a round of 1.5 km",
            Self::Suburban => "houses in gardens along curved roads; a round of 1.5 km",
            Self::Rural => "a country road with village, fields, forest, tunnel, level crossing, canal and farms",
            Self::Field => "a country road through open fields: degenerate geometry for odometry",
            Self::Tunnel => "a country road through tunnels of 110 m and more; the drive begins before the first one",
            Self::Motorway => "a motorway with two or three lanes each way: guard rails, verges, noise walls, gantries",
        }
    }
}

/// Density of the traffic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traffic {
    /// A leading vehicle, a few that follow, and oncoming ones.
    #[default]
    Normal,
    /// A one-way street full of vehicles that stand, start and stop with the ego vehicle, a bus beside it.
    Dense,
}

impl Traffic {
    /// All densities.
    pub const ALL: [Self; 2] = [Self::Normal, Self::Dense];

    /// Name in launch files and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Dense => "dense",
        }
    }
}
