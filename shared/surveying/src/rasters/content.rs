//! The quantities that images show, and how files describe them.

use super::cells::{Cells, NO_CLASS, NO_HEIGHT};
use messages::ClassId;
use std::fmt::Write;

/// Value of a cell that was measured, in the rasters of sources.
pub(super) const MEASURED: u8 = 1;
/// Value of a cell that was completed from its surroundings.
pub(super) const COMPLETED: u8 = 2;
/// Names of the values of the rasters of sources, from 0 on.
const SOURCES: [&str; 3] = ["", "measured", "completed"];
/// sRGB of these values: gray, green, orange.
const SOURCE_COLORS: [[u8; 3]; 3] = [[128; 3], [60, 140, 90], [240, 150, 40]];

/// The quantity that an image shows.
#[derive(Clone, Copy)]
pub(super) enum Content<'a> {
    Height,
    Terrain,
    TerrainSource,
    Difference,
    Density,
    /// Classes with sRGB by class id.
    Class(&'a [[u8; 3]; 256]),
    Color,
    Orthophoto,
    OrthophotoSource,
}

/// A band in words, for the metadata of GDAL.
struct Band {
    description: &'static str,
    unit: Option<&'static str>,
}

const fn metres(description: &'static str) -> Band {
    Band { description, unit: Some("metre") }
}

const fn unitless(description: &'static str) -> Band {
    Band { description, unit: None }
}

impl Content<'_> {
    /// Name of the file.
    pub(super) fn file_name(self) -> &'static str {
        match self {
            Self::Height => "height.tif",
            Self::Terrain => "terrain.tif",
            Self::TerrainSource => "terrain_source.tif",
            Self::Difference => "difference.tif",
            Self::Density => "density.tif",
            Self::Class(_) => "class.tif",
            Self::Color => "color.tif",
            Self::Orthophoto => "orthophoto.tif",
            Self::OrthophotoSource => "orthophoto_source.tif",
        }
    }

    /// Bytes of cells in the encoding of the file.
    pub(super) fn encode(self, cells: &Cells) -> Vec<u8> {
        let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect();
        match self {
            Self::Height => floats(&cells.height),
            Self::Terrain => floats(&cells.terrain),
            Self::Difference => floats(&cells.difference),
            Self::Density => floats(&cells.density),
            Self::TerrainSource => cells.terrain_source.clone(),
            Self::OrthophotoSource => cells.orthophoto_source.clone(),
            Self::Class(_) => cells.class.clone(),
            Self::Color => cells.color.concat(),
            Self::Orthophoto => cells.orthophoto.concat(),
        }
    }

    /// Bytes of a tile without points.
    pub(super) fn empty(self) -> Vec<u8> {
        self.encode(&Cells::joined(&[]))
    }

    /// Bits of each sample.
    pub(super) fn bits(self) -> Vec<u16> {
        match self {
            Self::Height | Self::Terrain | Self::Difference | Self::Density => vec![32],
            Self::Class(_) | Self::TerrainSource | Self::OrthophotoSource => vec![8],
            Self::Color | Self::Orthophoto => vec![8; 4],
        }
    }

    /// Whether the cells are colors with opacity.
    pub(super) fn is_color(self) -> bool {
        matches!(self, Self::Color | Self::Orthophoto)
    }

    /// sRGB of each value, for images with values from 0 to 255.
    pub(super) fn palette(self) -> Option<[[u8; 3]; 256]> {
        match self {
            Self::Class(colors) => Some(*colors),
            Self::TerrainSource | Self::OrthophotoSource => {
                Some(std::array::from_fn(|value| SOURCE_COLORS.get(value).copied().unwrap_or([0; 3])))
            }
            _ => None,
        }
    }

    /// Value of cells without data.
    pub(super) fn no_data(self) -> Option<String> {
        match self {
            Self::Color | Self::Orthophoto => None,
            _ if self.palette().is_some() => Some(NO_CLASS.to_string()),
            _ => Some(NO_HEIGHT.to_string()),
        }
    }

    fn bands(self) -> Vec<Band> {
        match self {
            Self::Height => vec![metres("height of the highest point")],
            Self::Terrain => vec![metres("height of the ground")],
            Self::TerrainSource => vec![unitless("source of the height of the ground")],
            Self::Difference => vec![metres("largest difference between drives in the height of the ground")],
            Self::Density => vec![Band { description: "density of points", unit: Some("1/m^2") }],
            Self::Class(_) => vec![unitless("class of the highest point")],
            Self::Color | Self::Orthophoto => ["red", "green", "blue", "opacity"].map(unitless).into(),
            Self::OrthophotoSource => vec![unitless("source of the color")],
        }
    }

    /// Descriptions and units of the bands: the XML of GDAL's tag 42112.
    pub(super) fn metadata(self) -> String {
        let mut xml = "<GDALMetadata>\n".to_owned();
        for (sample, Band { description, unit }) in self.bands().iter().enumerate() {
            let mut item = |name: &str, role: &str, text: &str| {
                // Writing to a string cannot fail.
                let _ = writeln!(xml, "  <Item name=\"{name}\" sample=\"{sample}\" role=\"{role}\">{text}</Item>");
            };
            item("DESCRIPTION", "description", description);
            if let Some(unit) = unit {
                item("UNITTYPE", "unittype", unit);
            }
        }
        xml + "</GDALMetadata>\n"
    }

    /// Names of the values from 0 on. Empty for quantities.
    fn categories(self) -> Vec<&'static str> {
        match self {
            Self::Class(_) => {
                let last = ClassId::ALL.iter().map(|class| *class as u8).max().unwrap_or(0);
                (0..=last).map(|id| ClassId::from_id(id).map_or("", ClassId::name)).collect()
            }
            Self::TerrainSource | Self::OrthophotoSource => SOURCES.to_vec(),
            _ => Vec::new(),
        }
    }

    /// The auxiliary file of GDAL (`.aux.xml`) with the names of the values, as categories and as attribute table. `None` for quantities.
    pub(super) fn auxiliary(self) -> Option<String> {
        let names = self.categories();
        let palette = self.palette().filter(|_| !names.is_empty())?;
        let mut xml = "<PAMDataset>\n  <PAMRasterBand band=\"1\">\n    <CategoryNames>\n".to_owned();
        // Writing to a string cannot fail.
        for name in &names {
            let _ = writeln!(xml, "      <Category>{name}</Category>");
        }
        xml += "    </CategoryNames>\n    <GDALRasterAttributeTable tableType=\"thematic\">\n";
        // Types and usages of GDAL: integer 0, string 2; value 5, name 2, red 6, green 7, blue 8.
        let fields = [("Value", 0, 5), ("Name", 2, 2), ("Red", 0, 6), ("Green", 0, 7), ("Blue", 0, 8)];
        for (index, (name, kind, usage)) in fields.into_iter().enumerate() {
            let _ = writeln!(
                xml,
                "      <FieldDefn index=\"{index}\"><Name>{name}</Name><Type>{kind}</Type><Usage>{usage}</Usage></FieldDefn>"
            );
        }
        let rows = names.iter().zip(palette).enumerate().filter(|(_, (name, _))| !name.is_empty());
        for (index, (value, (name, [red, green, blue]))) in rows.enumerate() {
            let _ = writeln!(
                xml,
                "      <Row index=\"{index}\"><F>{value}</F><F>{name}</F><F>{red}</F><F>{green}</F><F>{blue}</F></Row>"
            );
        }
        xml += "    </GDALRasterAttributeTable>\n  </PAMRasterBand>\n</PAMDataset>\n";
        Some(xml)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_band_has_a_description_and_lengths_have_units() {
        let colors = [[0; 3]; 256];
        for content in [
            Content::Height,
            Content::Terrain,
            Content::TerrainSource,
            Content::Difference,
            Content::Density,
            Content::Class(&colors),
            Content::Color,
            Content::Orthophoto,
            Content::OrthophotoSource,
        ] {
            let xml = content.metadata();
            let name = content.file_name();
            assert_eq!(xml.matches("role=\"description\"").count(), content.bits().len(), "{name}");
            assert_eq!(xml.contains("unittype"), content.bits() == [32], "{name}");
            assert_eq!(content.auxiliary().is_some(), content.palette().is_some(), "{name}");
        }
        let classes = Content::Class(&colors).auxiliary().expect("has names");
        assert!(classes.contains("<F>7</F><F>road</F>"), "{classes}");
        assert_eq!(classes.matches("<Row ").count(), ClassId::ALL.len());
    }
}
