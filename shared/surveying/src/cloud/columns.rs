//! Columns of a cloud (`docs/reference/outputs.md`).

use super::{CloudPoint, Present};
use formats::ply::{Header, Kind};

/// Offsets of the columns in a row.
pub(crate) struct Columns {
    row_size: usize,
    coordinates: Kind,
    xyz: usize,
    lidar_xyz: usize,
    timestamp: usize,
    index_frame: usize,
    intensity: usize,
    ring: usize,
    dynamic: usize,
    lidar: Option<usize>,
    instance: Option<usize>,
    /// Class and score.
    semantic: Option<[usize; 2]>,
    /// Red, followed by green, blue and camera.
    color: Option<usize>,
    /// Material and score.
    material: Option<[usize; 2]>,
    region: Option<usize>,
}

impl Columns {
    /// The columns of a cloud; else the rule that its header breaks.
    pub(crate) fn of(header: &Header) -> Result<Self, String> {
        let find = |name: &str| {
            let mut at = 0;
            for property in &header.properties {
                if property.name == name {
                    return Some((property.kind, at));
                }
                at += property.kind.size();
            }
            None
        };
        let optional = |name: &str, expected: Kind| match find(name) {
            Some((kind, _)) if kind != expected => {
                Err(format!("column `{name}` is {}, must be {}", kind.name(), expected.name()))
            }
            found => Ok(found.map(|(_, at)| at)),
        };
        let required =
            |name: &str, kind: Kind| optional(name, kind)?.ok_or_else(|| format!("the cloud has no column `{name}`"));
        // Columns that must follow one another.
        let run_of = |names: &[&str], kind: Kind| {
            let first = required(names[0], kind)?;
            for (k, name) in names.iter().enumerate() {
                if required(name, kind)? != first + k * kind.size() {
                    return Err(format!("column `{name}` must follow `{}`", names[k - 1]));
                }
            }
            Ok(first)
        };
        let coordinates = match find("x") {
            Some((Kind::Double, _)) => Kind::Double,
            _ => Kind::Float,
        };
        Ok(Self {
            row_size: header.row_size(),
            coordinates,
            xyz: run_of(&["x", "y", "z"], coordinates)?,
            lidar_xyz: run_of(&["x_lidar_position", "y_lidar_position", "z_lidar_position"], coordinates)?,
            timestamp: required("timestamp", Kind::Double)?,
            index_frame: required("index_frame", Kind::Int)?,
            intensity: required("intensity", Kind::UChar)?,
            ring: required("ring", Kind::UChar)?,
            dynamic: required("dynamic", Kind::UChar)?,
            lidar: optional("lidar", Kind::UChar)?,
            instance: optional("instance", Kind::Int)?,
            semantic: optional("semantic", Kind::UChar)?.zip(optional("score", Kind::Float)?).map(|(a, b)| [a, b]),
            color: match find("red") {
                Some(_) => Some(run_of(&["red", "green", "blue", "camera"], Kind::UChar)?),
                None => None,
            },
            material: optional("material", Kind::UChar)?
                .zip(optional("material_score", Kind::Float)?)
                .map(|(a, b)| [a, b]),
            region: optional("region", Kind::Int)?,
        })
    }

    pub(crate) fn row_size(&self) -> usize {
        self.row_size
    }

    pub(crate) fn present(&self) -> Present {
        Present {
            class: self.semantic.is_some(),
            instance: self.instance.is_some(),
            color: self.color.is_some(),
            lidar: self.lidar.is_some(),
            material: self.material.is_some(),
            region: self.region.is_some(),
        }
    }

    /// Sweep, LiDAR and laser of a row.
    #[inline]
    pub(crate) fn scan_line(&self, row: &[u8]) -> (u32, u8, u8) {
        let frame = i32::from_le_bytes(field(row, self.index_frame)) as u32;
        (frame, self.lidar.map_or(0, |at| row[at]), row[self.ring])
    }

    /// The point of a row.
    #[inline]
    pub(crate) fn point(&self, row: &[u8]) -> CloudPoint {
        let coordinates = |at: usize| match self.coordinates {
            Kind::Double => std::array::from_fn(|k| f64::from_le_bytes(field(row, at + 8 * k))),
            _ => std::array::from_fn(|k| f64::from(f32::from_le_bytes(field(row, at + 4 * k)))),
        };
        let with_score = |places: Option<[usize; 2]>| {
            places
                .map_or((0, 0), |[id, score]| (row[id], (f32::from_le_bytes(field(row, score)) * 255.0).round() as u8))
        };
        let (class, score) = with_score(self.semantic);
        let (material, material_score) = with_score(self.material);
        let [red, green, blue, camera] = self.color.map_or([0, 0, 0, messages::UNSEEN], |at| field(row, at));
        let (frame, lidar, ring) = self.scan_line(row);
        let number = |at: Option<usize>| at.map_or(0, |at| i32::from_le_bytes(field(row, at)) as u32);
        CloudPoint {
            xyz: coordinates(self.xyz),
            lidar_xyz: coordinates(self.lidar_xyz),
            time_s: f64::from_le_bytes(field(row, self.timestamp)),
            frame,
            intensity: row[self.intensity],
            ring,
            is_moving: row[self.dynamic] != 0,
            lidar,
            instance: number(self.instance),
            class,
            score,
            rgb: [red, green, blue],
            camera,
            material,
            material_score,
            region: number(self.region),
        }
    }
}

/// `N` bytes of a row. They lie inside the row by construction of [`Columns::of`].
#[inline]
fn field<const N: usize>(row: &[u8], at: usize) -> [u8; N] {
    row[at..at + N].try_into().expect("N bytes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_other_types_are_refused_by_name() {
        let columns = |change: fn(&mut Header)| {
            let floats = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
            let mut header = Header::new(floats.map(|name| (name, Kind::Float)).into_iter().chain([
                ("timestamp", Kind::Double),
                ("index_frame", Kind::Int),
                ("intensity", Kind::UChar),
                ("ring", Kind::UChar),
                ("dynamic", Kind::UChar),
            ]));
            change(&mut header);
            Columns::of(&header).map(|columns| columns.present())
        };
        assert_eq!(columns(|_| ()), Ok(Present::default()));
        let rule = columns(|header| header.properties[6].kind = Kind::Float).expect_err("refused");
        assert_eq!(rule, "column `timestamp` is float, must be double");
        let rule = columns(|header| header.properties.swap(1, 2)).expect_err("refused");
        assert_eq!(rule, "column `y` must follow `x`");
        let rule = columns(|header| drop(header.properties.remove(9))).expect_err("refused");
        assert_eq!(rule, "the cloud has no column `ring`");
    }
}
