//! Vertical systems and datums.

use super::registry::{self, Height};
use super::{Area, CrsError, METRE};

/// A vertical coordinate reference system of the EPSG registry: heights in metres above a geoid.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightSystem(Height);

/// The reference surface of heights.
#[derive(Clone, Debug, PartialEq)]
pub enum VerticalDatum {
    /// The ellipsoid of the horizontal datum, as in GNSS receivers.
    Ellipsoid,
    /// A geoid that the registry does not know, with the name of its grid.
    Geoid(String),
    /// A system of the registry.
    Registered(HeightSystem),
}

/// Vertical systems of grids: prefix of the names of the grids, and EPSG number.
const GRIDS: [(&str, u32); 4] = [("egm96", 5773), ("egm08", 3855), ("egm2008", 3855), ("raf", 5720)];

impl HeightSystem {
    /// The system of an EPSG number.
    pub fn from_epsg(epsg: u32) -> Result<Self, CrsError> {
        registry::height(epsg).map(Self).ok_or(CrsError::UnknownHeight(epsg))
    }
    /// Number in the EPSG registry.
    pub const fn epsg(&self) -> u32 {
        self.0.epsg
    }
    /// Name in the EPSG registry.
    pub const fn name(&self) -> &'static str {
        self.0.name
    }
    /// Where the system is defined.
    pub const fn area(&self) -> &Area {
        &self.0.area
    }
    /// Names of the geoid grids that the registry or PROJ have for it. Empty if they have no grid.
    pub fn grids(&self) -> &[&'static str] {
        &self.0.grids
    }
}

impl VerticalDatum {
    /// The datum of a geoid grid, by the name of its file.
    pub fn from_grid_name(name: &str) -> Self {
        let lower = name.to_lowercase();
        let known = GRIDS.iter().find(|(begin, _)| lower.starts_with(begin));
        let height = known.and_then(|(_, epsg)| HeightSystem::from_epsg(*epsg).ok());
        height.map_or_else(|| Self::Geoid(name.to_owned()), Self::Registered)
    }

    /// Number of the height in the EPSG registry, if it has one.
    pub fn epsg(&self) -> Option<u32> {
        match self {
            Self::Registered(height) => Some(height.epsg()),
            Self::Ellipsoid | Self::Geoid(_) => None,
        }
    }

    /// Name of the height.
    pub fn name(&self) -> String {
        match self {
            Self::Ellipsoid => "ellipsoidal height".to_owned(),
            Self::Geoid(grid) => format!("height above geoid {grid}"),
            Self::Registered(height) => height.name().to_owned(),
        }
    }

    /// `VERT_CS` in WKT 1.
    pub(super) fn wkt(&self) -> String {
        match self {
            // The type 2002 is a height above the ellipsoid. PROJ and GDAL read and write it in this form.
            Self::Ellipsoid => {
                format!(r#"VERT_CS["Ellipsoid (metre)",VERT_DATUM["Ellipsoid",2002],{METRE},AXIS["Up",UP]]"#)
            }
            Self::Registered(HeightSystem(Height { epsg, name, datum, datum_epsg, .. })) => format!(
                r#"VERT_CS["{name}",VERT_DATUM["{datum}",2005,AUTHORITY["EPSG","{datum_epsg}"]],{METRE},AXIS["Gravity-related height",UP],AUTHORITY["EPSG","{epsg}"]]"#
            ),
            Self::Geoid(grid) => format!(
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
        let name = |grid: &str| VerticalDatum::from_grid_name(grid).name();
        assert_eq!(name("egm96_15.gtx"), "EGM96 height");
        assert_eq!(name("EGM08_25.gtx"), "EGM2008 height");
        assert_eq!(name("mine.gtx"), "height above geoid mine.gtx");
        assert!(VerticalDatum::from_grid_name("RAF20.gtx").wkt().contains(
            r#"VERT_CS["NGF-IGN69 height",VERT_DATUM["Nivellement General de la France - IGN69",2005,AUTHORITY["EPSG","5119"]]"#
        ));
        let height = HeightSystem::from_epsg(7837).expect("is registered");
        assert_eq!((height.name(), height.grids()), ("DHHN2016 height", &["de_bkg_gcg2016.tif"][..]));
        assert!(VerticalDatum::Registered(height).wkt().ends_with(r#"AUTHORITY["EPSG","7837"]]"#));
        assert!(matches!(HeightSystem::from_epsg(25_832), Err(CrsError::UnknownHeight(25_832))));
    }
}
