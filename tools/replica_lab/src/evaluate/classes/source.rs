//! Sources of scored points: a label file, a simulated drive, real sweeps, real streets.

use super::tally::Tally;

/// Origin of points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Label files, without scores and positions.
    Files,
    /// Simulated towns, with the name of the sensor and its mounting.
    Simulated(String),
    /// Sweeps of SemanticKITTI.
    SemanticKitti,
    /// A labelled street, with the name of the data set.
    Street(String),
}

impl Origin {
    /// Whether the points were measured by a real sensor.
    pub fn is_real(&self) -> bool {
        matches!(self, Self::SemanticKitti | Self::Street(_))
    }
    /// Name in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Files => "label files".to_owned(),
            Self::Simulated(sensor) => format!("simulated, {sensor}"),
            Self::SemanticKitti => "SemanticKITTI".to_owned(),
            Self::Street(name) => name.clone(),
        }
    }
}

/// The points of one file, drive or sequence.
pub struct Source {
    /// Name in tables.
    pub name: String,
    /// Origin of its points.
    pub origin: Origin,
    /// Number of sweeps; 0 if unknown.
    pub n_sweeps: usize,
    /// Whether any of its points has an intensity.
    pub has_intensities: bool,
    /// The scores.
    pub tally: Tally,
    /// The scores with other uses of the intensities: a word of `--intensity` and the tally.
    pub other_uses: Vec<(&'static str, Tally)>,
}

/// The sources of one origin together.
pub struct Group {
    /// Name in tables.
    pub name: String,
    /// Number of sweeps; 0 if unknown.
    pub n_sweeps: usize,
    /// The scores.
    pub tally: Tally,
}

/// All sources of each origin, in the order of their first source.
pub fn groups(sources: &[Source]) -> Vec<Group> {
    let mut origins: Vec<&Origin> = Vec::new();
    for Source { origin, .. } in sources {
        if !origins.contains(&origin) {
            origins.push(origin);
        }
    }
    let group = |origin: &Origin| {
        let members = || sources.iter().filter(|source| source.origin == *origin);
        Group {
            name: origin.name(),
            n_sweeps: members().map(|source| source.n_sweeps).sum(),
            tally: Tally::sum(members().map(|source| &source.tally)),
        }
    };
    origins.into_iter().map(group).collect()
}
