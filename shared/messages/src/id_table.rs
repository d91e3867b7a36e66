//! Tables of ids with names, as enums.

/// An enum of ids from 0 on without gaps, each with a name: lower case, words joined by hyphens.
macro_rules! id_table {
    ($(#[$table_doc:meta])* $table:ident { $($(#[$doc:meta])* $variant:ident = $id:literal, $name:literal;)* }) => {
        $(#[$table_doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum $table { $($(#[$doc])* $variant = $id),* }

        impl $table {
            /// All ids in ascending order.
            pub const ALL: &'static [$table] = &[$($table::$variant),*];

            /// Name of the id: lower case, words joined by hyphens.
            pub const fn name(self) -> &'static str {
                match self { $($table::$variant => $name),* }
            }
            /// The id with this number. `None` past the last id.
            pub const fn from_id(id: u8) -> Option<Self> {
                match id { $($id => Some($table::$variant),)* _ => None }
            }
            /// The id with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($name => Some($table::$variant),)* _ => None }
            }
        }
    };
}
pub(crate) use id_table;
