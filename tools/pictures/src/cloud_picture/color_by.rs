//! The attribute that the color of a point shows: a field of the table of columns, or a property of its cloud.

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use messages::columns::{COLUMNS, Column, ColumnField, FieldType, NamedIds, Shown};
use std::ffi::OsStr;

/// The attribute that a point's color shows.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorBy {
    /// Color from the cameras.
    Color,
    /// Class, in CARLA's colors.
    Class,
    /// Intensity of the return.
    Intensity,
    /// Material; points without spectrum are gray.
    Material,
    /// Instance; points without an instance are gray.
    Instance,
    /// Time of the return.
    Time,
    /// Any other field.
    Field(ShownField),
    /// Height.
    Height,
    /// A color for each cloud.
    Submap,
    /// Reflectance of the band of --band-nm; points without spectrum are gray.
    Band,
    /// Stated standard deviation of the horizontal position of the submap.
    Sigma,
}

/// A field of the clouds without its own coloring.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownField {
    /// Name in the legend.
    pub name: String,
    /// Property of the PLY files.
    pub property: String,
    /// How it is shown.
    pub shown: Shown,
    /// Value that marks points without a value.
    pub none: Option<f64>,
    /// Values at the ends of the ramp. `None`: most values lie between the ends.
    pub range: Option<[f64; 2]>,
    /// Names of its values.
    pub names: Option<NamedIds>,
}

/// Words that are not fields, and their meanings.
const OTHERS: [(&str, ColorBy, &str); 4] = [
    ("height", ColorBy::Height, "Height"),
    ("submap", ColorBy::Submap, "A color for each cloud"),
    ("band", ColorBy::Band, "Reflectance of the band of --band-nm; points without spectrum are gray"),
    ("sigma", ColorBy::Sigma, "Stated standard deviation of the horizontal position of the submap"),
];

impl ColorBy {
    /// The attribute of a word: a field of `table` that is shown, or a property of the clouds. `None` if it cannot be a property.
    pub fn from_word(word: &str, table: &'static [Column]) -> Option<Self> {
        let other = OTHERS.into_iter().find(|(name, ..)| *name == word).map(|(_, by, _)| by);
        let field = || fields(table).find(|(name, _)| *name == word).map(|(_, field)| Self::from_field(field));
        let is_name = |word: &str| word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        let property = || (!word.is_empty() && is_name(word)).then(|| Self::Field(ShownField::from_property(word)));
        other.or_else(field).or_else(property)
    }

    fn from_field(field: &ColumnField) -> Self {
        match (field.shown, field.name) {
            (Shown::Color, _) => Self::Color,
            (_, "class") => Self::Class,
            (_, "intensity") => Self::Intensity,
            (_, "material") => Self::Material,
            (_, "instance") => Self::Instance,
            (_, "time") => Self::Time,
            _ => Self::Field(ShownField::from_field(field)),
        }
    }
}

impl ShownField {
    fn from_field(field: &ColumnField) -> Self {
        let unit = if field.unit.is_empty() { String::new() } else { format!(", {}", field.unit) };
        Self {
            name: format!("{}{unit}", field.name),
            property: field.property.to_owned(),
            shown: field.shown,
            none: field.none,
            range: (field.kind == FieldType::Share).then_some([0.0, 1.0]),
            names: field.names,
        }
    }

    /// A property that the table does not have.
    fn from_property(name: &str) -> Self {
        let property = name.to_owned();
        Self { name: property.clone(), property, shown: Shown::Ramp, none: None, range: None, names: None }
    }
}

/// Words and fields of a table that are shown.
fn fields(table: &'static [Column]) -> impl Iterator<Item = (&'static str, &'static ColumnField)> {
    let fields = table.iter().flat_map(|column| column.fields.iter().map(move |field| (column, field)));
    fields.filter(|(_, field)| field.shown != Shown::No).map(|(column, field)| {
        // Red, green and blue are one attribute.
        (if field.shown == Shown::Color { column.name } else { field.name }, field)
    })
}

/// Reads `--by`: words of the table of columns, or the name of a property of the clouds.
#[derive(Clone)]
pub struct ColorByParser;

impl TypedValueParser for ColorByParser {
    type Value = ColorBy;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<ColorBy, clap::Error> {
        let word = value.to_string_lossy();
        ColorBy::from_word(&word, COLUMNS).ok_or_else(|| {
            let mut error = clap::Error::new(ErrorKind::InvalidValue).with_cmd(command);
            if let Some(argument) = argument {
                error.insert(ContextKind::InvalidArg, ContextValue::String(argument.to_string()));
            }
            error.insert(ContextKind::InvalidValue, ContextValue::String(word.into_owned()));
            error
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let fields = fields(COLUMNS).map(|(word, field)| PossibleValue::new(word).help(field.description));
        let others = OTHERS.into_iter().map(|(word, _, help)| PossibleValue::new(word).help(help));
        Some(Box::new(fields.chain(others)))
    }
}

/// All words of `--by`.
pub fn words() -> Vec<&'static str> {
    fields(COLUMNS).map(|(word, _)| word).chain(OTHERS.into_iter().map(|(word, ..)| word)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_the_table_have_their_colorings_and_other_words_are_properties() {
        let of_word = |word| ColorBy::from_word(word, COLUMNS);
        assert_eq!((of_word("color"), of_word("class")), (Some(ColorBy::Color), Some(ColorBy::Class)));
        assert_eq!((of_word("height"), of_word("time")), (Some(ColorBy::Height), Some(ColorBy::Time)));
        for (word, property, shown) in [
            ("moving", "dynamic", Shown::Flag),
            ("region", "region", Shown::Ids),
            ("moisture", "moisture", Shown::Ramp),
        ] {
            let Some(ColorBy::Field(field)) = of_word(word) else { panic!("{word} is a field") };
            assert_eq!((field.property.as_str(), field.shown), (property, shown));
        }
        assert_eq!((of_word(""), of_word("a b")), (None, None));
        assert!(words().contains(&"region") && words().contains(&"sigma"));
    }
}
