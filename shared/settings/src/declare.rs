//! The declaration of settings.

/// Declares settings. Each line: meaning as a doc comment, key, type, default, rule.
///
/// ```
/// settings::settings! {
///     /// Settings of the example.
///     pub struct Settings {
///         /// Length of a submap along the path, m.
///         pub submap_m: f64 = 20.0 => settings::within(1.0, 1000.0);
///     }
/// }
/// let table = toml::de::DeTable::parse("submap_m = 2000.0\nsubmap = 1.0").unwrap();
/// let (_, problems) = settings::parse_table::<Settings>(table.get_ref());
/// assert_eq!(problems.len(), 2);
/// ```
#[macro_export]
macro_rules! settings {
    ($(#[$meta:meta])* pub struct $name:ident {
        $( $(#[doc = $meaning:literal])* pub $key:ident: $kind:ty = $default:expr => $rule:expr; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $( $(#[doc = $meaning])* pub $key: $kind, )* }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $key: $default, )* }
            }
        }

        // Written out: the derive would have to name the crate through which the caller reaches serde.
        impl $crate::serde::Serialize for $name {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                use $crate::serde::ser::SerializeMap;
                #[allow(unused_mut, reason = "a stage without settings has nothing to write")]
                let mut map = serializer.serialize_map(None)?;
                $( map.serialize_entry(stringify!($key), &self.$key)?; )*
                map.end()
            }
        }

        impl $crate::Settings for $name {
            fn fields() -> Vec<$crate::Field> {
                vec![$({
                    let default: $kind = $default;
                    let rule: &dyn $crate::Rule<$kind> = &$rule;
                    $crate::Field {
                        key: stringify!($key).to_owned(),
                        kind: rule.kind().map_or_else(|| stringify!($kind).replace(' ', ""), str::to_owned),
                        default: $crate::default_text(&default),
                        rule: rule.text(),
                        meaning: [$($meaning),*].join("").trim().to_owned(),
                    }
                }),*]
            }

            #[allow(unused_variables, reason = "a stage without settings has nothing to set")]
            fn set(
                &mut self,
                key: &str,
                value: $crate::toml::Spanned<$crate::toml::de::DeValue<'_>>,
            ) -> Option<Result<(), $crate::SettingError>> {
                match key {
                    $( stringify!($key) => {
                        let rule: &dyn $crate::Rule<$kind> = &$rule;
                        Some(rule.read(value).map(|value| self.$key = value))
                    } )*
                    _ => None,
                }
            }
        }
    };
}
