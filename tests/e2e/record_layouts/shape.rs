//! The layout of a type as it describes itself to serde: what stands where in a record without names, such as postcard's.
//!
//! Types are taken apart by deserialising them from nothing, again and again until every variant of every enumeration has been
//! seen. An enumeration is known by its place, not by its name, since two types of one record may have the same name (which
//! is why `serde-reflection` does not do).
//!
//! Limits: types that refuse zeros and empty texts, maps, and types that ask what comes next (`flatten`, `untagged`).

use std::fmt;

use serde::de::value::Error;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error as _, IntoDeserializer, SeqAccess,
    VariantAccess, Visitor,
};

/// What stands at a place.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Shape {
    /// Not looked at yet.
    #[default]
    Unknown,
    /// A number, a text or nothing.
    Plain(&'static str),
    /// There or not.
    Optional(Box<Shape>),
    /// Any number of them.
    List(Box<Shape>),
    /// A name for one other.
    Named(&'static str, Box<Shape>),
    /// One after another.
    Fields(&'static str, Vec<(String, Shape)>),
    /// One of them, known by its number.
    Variants(&'static str, Vec<(&'static str, Shape)>),
}

/// Passes that no record needs: each shows a variant more, wherever one is missing.
const MOST_PASSES: usize = 1000;

/// The layout of a type.
///
/// # Panics
/// When the type cannot be taken apart; see the limits.
pub fn of<T: DeserializeOwned>() -> Shape {
    let mut shape = Shape::Unknown;
    for _ in 0..MOST_PASSES {
        if shape.is_whole() {
            return shape;
        }
        if let Err(error) = T::deserialize(Place(&mut shape)) {
            panic!("the type does not describe itself: {error}\n{shape}");
        }
    }
    panic!("not seen whole in {MOST_PASSES} passes:\n{shape}")
}

impl Shape {
    fn is_whole(&self) -> bool {
        match self {
            Self::Unknown => false,
            Self::Plain(_) => true,
            Self::Optional(inner) | Self::List(inner) | Self::Named(_, inner) => inner.is_whole(),
            Self::Fields(_, fields) => fields.iter().all(|(_, field)| field.is_whole()),
            Self::Variants(_, variants) => variants.iter().all(|(_, variant)| variant.is_whole()),
        }
    }

    /// The field places, which this becomes unless it is that already.
    fn fields(&mut self, name: &'static str, fields: impl Iterator<Item = String>) -> &mut [(String, Self)] {
        if *self == Self::Unknown {
            *self = Self::Fields(name, fields.map(|field| (field, Self::Unknown)).collect());
        }
        let Self::Fields(_, places) = self else { unreachable!("a place does not change: {self:?}") };
        places
    }

    /// The place within, likewise.
    fn inner(&mut self, becomes: impl Fn(Box<Self>) -> Self) -> &mut Self {
        if *self == Self::Unknown {
            *self = becomes(Box::default());
        }
        let (Self::Optional(inner) | Self::List(inner) | Self::Named(_, inner)) = self else {
            unreachable!("a place does not change: {self:?}")
        };
        inner
    }

    /// A line for each place, indented by its depth.
    fn write(&self, f: &mut fmt::Formatter<'_>, depth: usize, place: &str) -> fmt::Result {
        let mut line = |what: &str| writeln!(f, "{:indent$}{place}: {what}", "", indent = 2 * depth);
        match self {
            Self::Unknown => line("?"),
            Self::Plain(name) => line(name),
            Self::Optional(inner) => inner.write(f, depth, &format!("{place} optional")),
            Self::List(inner) => inner.write(f, depth, &format!("{place} list of")),
            Self::Named(name, inner) => inner.write(f, depth, &format!("{place} {name}")),
            Self::Fields("", fields) if fields.iter().all(|field| Some(&field.1) == first(fields)) => {
                let Some(element) = first(fields) else { return line("nothing") };
                element.write(f, depth, &format!("{place} {} of", fields.len()))
            }
            Self::Fields(name, fields) => {
                line(name)?;
                fields.iter().try_for_each(|(field, shape)| shape.write(f, depth + 1, field))
            }
            Self::Variants(name, variants) => {
                line(&format!("one of {name}"))?;
                let mut numbered = variants.iter().enumerate();
                numbered.try_for_each(|(i, (variant, shape))| {
                    shape.write(f, depth + 1, &format!("{i} {variant}"))
                })
            }
        }
    }
}

fn first(fields: &[(String, Shape)]) -> Option<&Shape> {
    fields.first().map(|(_, shape)| shape)
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, 0, "record")
    }
}

/// A place that is being looked at.
struct Place<'a>(&'a mut Shape);

macro_rules! plain {
    ($($method:ident $visit:ident $value:expr, $name:literal;)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            *self.0 = Shape::Plain($name);
            visitor.$visit($value)
        }
    )*};
}

macro_rules! refused {
    ($($method:ident)*) => {$(
        fn $method<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
            Err(Error::custom(concat!(stringify!($method), " is not followed")))
        }
    )*};
}

impl<'de> Deserializer<'de> for Place<'_> {
    type Error = Error;

    plain! {
        deserialize_bool visit_bool false, "bool";
        deserialize_i8 visit_i8 0, "i8";
        deserialize_i16 visit_i16 0, "i16";
        deserialize_i32 visit_i32 0, "i32";
        deserialize_i64 visit_i64 0, "i64";
        deserialize_u8 visit_u8 0, "u8";
        deserialize_u16 visit_u16 0, "u16";
        deserialize_u32 visit_u32 0, "u32";
        deserialize_u64 visit_u64 0, "u64";
        deserialize_f32 visit_f32 0.0, "f32";
        deserialize_f64 visit_f64 0.0, "f64";
        deserialize_char visit_char 'a', "char";
        deserialize_str visit_borrowed_str "", "text";
        deserialize_string visit_borrowed_str "", "text";
        deserialize_bytes visit_borrowed_bytes b"", "bytes";
        deserialize_byte_buf visit_borrowed_bytes b"", "bytes";
    }

    refused! { deserialize_any deserialize_map deserialize_identifier deserialize_ignored_any }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        *self.0 = Shape::Plain("nothing");
        visitor.visit_unit()
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.deserialize_unit(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_some(Place(self.0.inner(Shape::Optional)))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(Place(self.0.inner(|inner| Shape::Named(name, inner))))
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_seq(Places(std::iter::once(self.0.inner(Shape::List))))
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_tuple_struct("", length, visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        let places = self.0.fields(name, (0..length).map(|i| i.to_string()));
        visitor.visit_seq(Places(places.iter_mut().map(|(_, place)| place)))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let places = self.0.fields(name, fields.iter().map(|field| (*field).to_string()));
        visitor.visit_seq(Places(places.iter_mut().map(|(_, place)| place)))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        if *self.0 == Shape::Unknown {
            *self.0 = Shape::Variants(name, variants.iter().map(|v| (*v, Shape::Unknown)).collect());
        }
        let Shape::Variants(_, places) = self.0 else { unreachable!("a place does not change") };
        let wanted = places.iter().position(|(_, place)| !place.is_whole()).unwrap_or(0);
        let Some((_, place)) = places.get_mut(wanted) else {
            return Err(Error::custom(format!("{name} has no variant")));
        };
        visitor.visit_enum(Variant {
            number: u32::try_from(wanted).map_err(Error::custom)?,
            place: Place(place),
        })
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

struct Places<I>(I);

impl<'de, 'a, I: Iterator<Item = &'a mut Shape>> SeqAccess<'de> for Places<I> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Error> {
        self.0.next().map(|place| seed.deserialize(Place(place))).transpose()
    }
}

struct Variant<'a> {
    number: u32,
    place: Place<'a>,
}

impl<'de, 'a> EnumAccess<'de> for Variant<'a> {
    type Error = Error;
    type Variant = Place<'a>;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Place<'a>), Error> {
        Ok((seed.deserialize(self.number.into_deserializer())?, self.place))
    }
}

impl<'de> VariantAccess<'de> for Place<'_> {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        *self.0 = Shape::Plain("nothing");
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Error> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Error> {
        self.deserialize_tuple(length, visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.deserialize_struct("fields", fields, visitor)
    }
}
