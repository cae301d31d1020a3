//! Layout of a type in a record without field names, such as postcard's, from its `serde` description.
//!
//! A type is deserialised from generated values, repeatedly, until every variant of every enumeration has occurred. An enumeration is
//! identified by its position and not by its name: two types of one record may have the same name, which
//! `serde-reflection` does not support.
//!
//! Unsupported: types that reject zeros or empty texts, maps, and types that need a self-describing format (`flatten`,
//! `untagged`).

use std::fmt;

use serde::de::value::Error;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error as _, IntoDeserializer, SeqAccess,
    VariantAccess, Visitor,
};

/// Layout at one position of a record.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum RecordLayout {
    /// Not visited yet.
    #[default]
    Unknown,
    /// A number, a text or nothing.
    Plain(&'static str),
    /// Present or absent.
    Optional(Box<RecordLayout>),
    /// Any number of equal elements.
    List(Box<RecordLayout>),
    /// A newtype.
    Named(&'static str, Box<RecordLayout>),
    /// Fields in sequence.
    Fields(&'static str, Vec<(String, RecordLayout)>),
    /// Alternatives by number.
    Variants(&'static str, Vec<(&'static str, RecordLayout)>),
}

/// Upper bound of passes; each visits one more variant of every enumeration that is incomplete.
const MAX_PASSES: usize = 1000;

/// The layout of a type.
///
/// # Panics
/// When the type is not supported.
pub fn of<T: DeserializeOwned>() -> RecordLayout {
    let mut layout = RecordLayout::Unknown;
    for _ in 0..MAX_PASSES {
        if layout.is_complete() {
            return layout;
        }
        if let Err(error) = T::deserialize(LayoutSlot(&mut layout)) {
            panic!("the type does not describe itself: {error}\n{layout}");
        }
    }
    panic!("incomplete after {MAX_PASSES} passes:\n{layout}")
}

impl RecordLayout {
    fn is_complete(&self) -> bool {
        match self {
            Self::Unknown => false,
            Self::Plain(_) => true,
            Self::Optional(inner) | Self::List(inner) | Self::Named(_, inner) => inner.is_complete(),
            Self::Fields(_, fields) => fields.iter().all(|(_, field)| field.is_complete()),
            Self::Variants(_, variants) => variants.iter().all(|(_, variant)| variant.is_complete()),
        }
    }

    /// The fields, which are created at the first visit.
    fn fields(&mut self, name: &'static str, fields: impl Iterator<Item = String>) -> &mut [(String, Self)] {
        if *self == Self::Unknown {
            *self = Self::Fields(name, fields.map(|field| (field, Self::Unknown)).collect());
        }
        let Self::Fields(_, places) = self else { unreachable!("a place does not change: {self:?}") };
        places
    }

    /// The inner layout, likewise.
    fn inner(&mut self, becomes: impl Fn(Box<Self>) -> Self) -> &mut Self {
        if *self == Self::Unknown {
            *self = becomes(Box::default());
        }
        let (Self::Optional(inner) | Self::List(inner) | Self::Named(_, inner)) = self else {
            unreachable!("a place does not change: {self:?}")
        };
        inner
    }

    /// Writes one line for each position, indented by its depth.
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
                fields.iter().try_for_each(|(field, layout)| layout.write(f, depth + 1, field))
            }
            Self::Variants(name, variants) => {
                line(&format!("one of {name}"))?;
                let mut numbered = variants.iter().enumerate();
                numbered.try_for_each(|(i, (variant, layout))| {
                    layout.write(f, depth + 1, &format!("{i} {variant}"))
                })
            }
        }
    }
}

fn first(fields: &[(String, RecordLayout)]) -> Option<&RecordLayout> {
    fields.first().map(|(_, layout)| layout)
}

impl fmt::Display for RecordLayout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, 0, "record")
    }
}

/// Deserialiser that records the layout of one position.
struct LayoutSlot<'a>(&'a mut RecordLayout);

macro_rules! plain {
    ($($method:ident $visit:ident $value:expr, $name:literal;)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            *self.0 = RecordLayout::Plain($name);
            visitor.$visit($value)
        }
    )*};
}

macro_rules! unsupported {
    ($($method:ident)*) => {$(
        fn $method<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
            Err(Error::custom(concat!(stringify!($method), " is not supported")))
        }
    )*};
}

impl<'de> Deserializer<'de> for LayoutSlot<'_> {
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

    unsupported! { deserialize_any deserialize_map deserialize_identifier deserialize_ignored_any }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        *self.0 = RecordLayout::Plain("nothing");
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
        visitor.visit_some(LayoutSlot(self.0.inner(RecordLayout::Optional)))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(LayoutSlot(self.0.inner(|inner| RecordLayout::Named(name, inner))))
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_seq(ElementSlots(std::iter::once(self.0.inner(RecordLayout::List))))
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
        visitor.visit_seq(ElementSlots(places.iter_mut().map(|(_, place)| place)))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let places = self.0.fields(name, fields.iter().map(|field| (*field).to_string()));
        visitor.visit_seq(ElementSlots(places.iter_mut().map(|(_, place)| place)))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        if *self.0 == RecordLayout::Unknown {
            *self.0 =
                RecordLayout::Variants(name, variants.iter().map(|v| (*v, RecordLayout::Unknown)).collect());
        }
        let RecordLayout::Variants(_, places) = self.0 else { unreachable!("a place does not change") };
        let wanted = places.iter().position(|(_, place)| !place.is_complete()).unwrap_or(0);
        let Some((_, place)) = places.get_mut(wanted) else {
            return Err(Error::custom(format!("{name} has no variant")));
        };
        visitor.visit_enum(VariantSlot {
            number: u32::try_from(wanted).map_err(Error::custom)?,
            slot: LayoutSlot(place),
        })
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

struct ElementSlots<I>(I);

impl<'de, 'a, I: Iterator<Item = &'a mut RecordLayout>> SeqAccess<'de> for ElementSlots<I> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Error> {
        self.0.next().map(|place| seed.deserialize(LayoutSlot(place))).transpose()
    }
}

struct VariantSlot<'a> {
    number: u32,
    slot: LayoutSlot<'a>,
}

impl<'de, 'a> EnumAccess<'de> for VariantSlot<'a> {
    type Error = Error;
    type Variant = LayoutSlot<'a>;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, LayoutSlot<'a>), Error> {
        Ok((seed.deserialize(self.number.into_deserializer())?, self.slot))
    }
}

impl<'de> VariantAccess<'de> for LayoutSlot<'_> {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        *self.0 = RecordLayout::Plain("nothing");
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
