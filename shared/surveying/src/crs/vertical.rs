//! Vertical datums.

use super::METRE;

/// The reference surface of heights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum VerticalDatum {
    /// The ellipsoid of the horizontal datum, as in GNSS receivers.
    Ellipsoid,
    /// A geoid, with the name of its grid.
    Geoid(String),
}

/// Geoids of the EPSG registry: prefix of the names of their grids, name and number of the height, name and number of the
/// datum.
const REGISTERED: [(&str, &str, u32, &str, u32); 4] = [
    ("egm96", "EGM96 height", 5773, "EGM96 geoid", 5171),
    ("egm08", "EGM2008 height", 3855, "EGM2008 geoid", 1027),
    ("egm2008", "EGM2008 height", 3855, "EGM2008 geoid", 1027),
    ("raf", "NGF-IGN69 height", 5720, "Nivellement General de la France - IGN69", 5119),
];

impl VerticalDatum {
    fn registered(&self) -> Option<(&'static str, u32, &'static str, u32)> {
        let Self::Geoid(grid) = self else { return None };
        let grid = grid.to_lowercase();
        let found = REGISTERED.iter().find(|(begin, ..)| grid.starts_with(begin));
        found.map(|(_, name, epsg, datum, datum_epsg)| (*name, *epsg, *datum, *datum_epsg))
    }

    /// Number of the height in the EPSG registry, if it has one.
    pub fn epsg(&self) -> Option<u32> {
        self.registered().map(|(_, epsg, ..)| epsg)
    }

    /// Name of the height.
    pub fn name(&self) -> String {
        match (self, self.registered()) {
            (_, Some((name, ..))) => name.to_owned(),
            (Self::Ellipsoid, _) => "ellipsoidal height".to_owned(),
            (Self::Geoid(grid), _) => format!("height above geoid {grid}"),
        }
    }

    /// `VERT_CS` in WKT 1.
    pub(super) fn wkt(&self) -> String {
        match (self, self.registered()) {
            // The type 2002 is a height above the ellipsoid. PROJ and GDAL read and write it in this form.
            (Self::Ellipsoid, _) => {
                format!(r#"VERT_CS["Ellipsoid (metre)",VERT_DATUM["Ellipsoid",2002],{METRE},AXIS["Up",UP]]"#)
            }
            (_, Some((name, epsg, datum, datum_epsg))) => format!(
                r#"VERT_CS["{name}",VERT_DATUM["{datum}",2005,AUTHORITY["EPSG","{datum_epsg}"]],{METRE},AXIS["Gravity-related height",UP],AUTHORITY["EPSG","{epsg}"]]"#
            ),
            (Self::Geoid(grid), None) => format!(
                r#"VERT_CS["{}",VERT_DATUM["geoid {grid}",2005],{METRE},AXIS["Gravity-related height",UP]]"#,
                self.name()
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geoids_of_the_registry_are_known_by_the_names_of_their_grids() {
        let name = |grid: &str| VerticalDatum::Geoid(grid.to_owned()).name();
        assert_eq!(name("egm96_15.gtx"), "EGM96 height");
        assert_eq!(name("EGM08_25.gtx"), "EGM2008 height");
        assert_eq!(name("mine.gtx"), "height above geoid mine.gtx");
        assert!(VerticalDatum::Geoid("RAF20.gtx".to_owned()).wkt().contains(r#"AUTHORITY["EPSG","5720"]"#));
    }
}
