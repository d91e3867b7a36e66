//! Names of the fields.

/// A field of a cloud that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// x, m.
    X,
    /// y, m.
    Y,
    /// z, m.
    Z,
    /// Intensity or reflectance of the return.
    Intensity,
    /// Number of the beam.
    Ring,
    /// Time of the shot.
    Time,
}

impl Field {
    /// All fields.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Intensity, Self::Ring, Self::Time];

    /// Names in lower case, the preferred name first. `CloudCompare` writes them with the prefix `scalar_`.
    pub const fn names(self) -> &'static [&'static str] {
        match self {
            Self::X => &["x"],
            Self::Y => &["y"],
            Self::Z => &["z"],
            Self::Intensity => &["intensity", "intensities", "reflectance", "reflectivity", "remission", "i"],
            Self::Ring => &["ring", "laser", "channel", "line", "laser_id", "laserid"],
            Self::Time => &[
                "t",
                "time",
                "timestamp",
                "time_stamp",
                "gps_time",
                "gpstime",
                "offset_time",
                "point_time",
                "time_offset",
            ],
        }
    }

    /// Index of the field among these names. The letter case is ignored, but a name in lower case is preferred.
    pub fn find<'a>(self, names: &(impl Iterator<Item = &'a str> + Clone)) -> Option<usize> {
        let position =
            |wanted: &str, is_same: fn(&str, &str) -> bool| names.clone().position(|name| is_same(name, wanted));
        self.names()
            .iter()
            .find_map(|wanted| position(wanted, |name, wanted| name == wanted).or_else(|| position(wanted, is_synonym)))
    }
}

/// Whether a name is the wanted one in another letter case, or with the prefix of `CloudCompare`.
fn is_synonym(name: &str, wanted: &str) -> bool {
    let bare = match name.get(..7) {
        Some(prefix) if prefix.eq_ignore_ascii_case("scalar_") => &name[7..],
        _ => name,
    };
    bare.eq_ignore_ascii_case(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_all_writers_are_found() {
        for (writer, names, found) in [
            ("PCL", "x y z intensity", [Some(0), Some(1), Some(2), Some(3), None, None]),
            ("PDAL", "X Y Z Intensity GpsTime", [Some(0), Some(1), Some(2), Some(3), None, Some(4)]),
            (
                "CloudCompare",
                "x y z scalar_Intensity scalar_GpsTime",
                [Some(0), Some(1), Some(2), Some(3), None, Some(4)],
            ),
            (
                "Livox",
                "x y z reflectivity tag line offset_time",
                [Some(0), Some(1), Some(2), Some(3), Some(5), Some(6)],
            ),
            (
                "Ouster",
                "x y z intensity t reflectivity ring ambient range",
                [Some(0), Some(1), Some(2), Some(3), Some(6), Some(4)],
            ),
            ("Hesai", "x y z intensity timestamp ring", [Some(0), Some(1), Some(2), Some(3), Some(5), Some(4)]),
            ("normals", "normal_x x y z X", [Some(1), Some(2), Some(3), None, None, None]),
        ] {
            let names: Vec<&str> = names.split(' ').collect();
            assert_eq!(Field::ALL.map(|field| field.find(&names.iter().copied())), found, "{writer}");
        }
    }
}
