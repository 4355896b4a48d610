//! The shape that all option structs of this crate share.

/// Defines a `#[non_exhaustive]` option struct whose fields carry their default, a `with_…` setter
/// for each field, `Default`, and `validate`, which checks each field's requirement.
macro_rules! options {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $(
                $(#[$field_meta:meta])*
                $field:ident / $setter:ident : $type:ty = $default:expr
                    $(, $requirement:literal if |$value:ident| $check:expr)? ;
            )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq)]
        #[non_exhaustive]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $type, )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $field: $default, )* }
            }
        }

        impl $name {
            $(
                #[doc = concat!("Sets [`", stringify!($field), "`](Self::", stringify!($field), ").")]
                #[must_use]
                pub fn $setter(mut self, value: $type) -> Self {
                    self.$field = value;
                    self
                }
            )*

            /// Checks every option against its range.
            ///
            /// # Errors
            /// The first option outside its range.
            pub fn validate(&self) -> Result<(), $crate::OptionError> {
                $( $(
                    let $value = self.$field;
                    let holds: bool = $check;
                    if !holds {
                        return Err($crate::OptionError {
                            name: stringify!($field),
                            value: $value.to_string(),
                            requirement: $requirement,
                        });
                    }
                )? )*
                Ok(())
            }
        }
    };
}

pub(crate) use options;
