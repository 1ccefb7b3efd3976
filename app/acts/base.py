"""The base of every act: one model for form, API body and command line, which builds one gate command."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, field_validator

from app.i18n.messages import lazy_gettext
from app.i18n.visible_text import unseen_in
from app.views import forms
from app.views.forms import Wrong
from harness.contracts.actors import Actor, Command
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

Reason = Annotated[str, StringConstraints(min_length=1, max_length=forms.REASON_SIGNS)]
Key = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Slug = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Text = Annotated[str, StringConstraints(max_length=200)]
Sha256 = Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=0, le=2**53)]
WHY = ("reason", "statement")
"""Fields that a person fills in on a form; a form that lacks any other field is not one of ours."""


class ActModel(BaseModel):
    """What a person says when they do something: a form, an API body and the command line fill in the same fields.

    The address says what it is done to. A key, where an act has one, makes the same act again the same receipt.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    sentences: ClassVar[Mapping[str, str]] = {}
    """What a person is told about a field of a form that they filled in wrongly."""

    @field_validator("*")
    @classmethod
    def _readable(cls, value: Any) -> Any:
        """Refuses what a reader would not see, or would see in another order than it is stored."""
        if unseen := unseen_in(value):
            raise ValueError(f"{unseen} is a control or an invisible character")
        return value

    def body(self) -> dict[str, Any]:
        """The JSON body that the API takes for this act."""
        return self.model_dump(mode="json", exclude_none=True)

    @classmethod
    def of(cls, **given: Any) -> Self:
        """The act with these fields. Raises ContractInvalid that names the first one that does not hold."""
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise ContractInvalid(because("act_invalid", name=where, error=first["msg"]), where=where) from error

    @classmethod
    def from_form(cls, typed: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """The act of a posted form, or what is wrong with what was typed. Blank fields count as left out.

        A form carries fields that other buttons of its page need; those are left aside. Raises ContractInvalid where
        a field is missing that the page itself fills in.
        """
        known = {name: typed.get(name, "").strip() for name in cls.model_fields}
        return cls._read({name: text for name, text in known.items() if text})

    @classmethod
    def _read(cls, given: Mapping[str, Any]) -> Self | tuple[Wrong, ...]:
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            fields = dict.fromkeys(str(one["loc"][0]) for one in error.errors() if one["loc"])
        strange = next((name for name in fields if name not in (*WHY, *cls.sentences)), None)
        if strange is not None:
            raise ContractInvalid(because("answer_unbound"), where=strange)
        return tuple(
            Wrong(name, text)
            for name in fields
            for text in _unread(given.get(name)) or cls._messages(name, given.get(name, ""))
        )

    @classmethod
    def _read_as(cls, given: Mapping[str, Any], typed_as: Mapping[str, str]) -> Self | tuple[Wrong, ...]:
        """`typed_as`: what fields are called on the form, where it is not their own name."""
        act = cls._read(given)
        if isinstance(act, tuple):
            return tuple(Wrong(typed_as.get(one.field, one.field), one.text) for one in act)
        return act

    @classmethod
    def _messages(cls, name: str, value: Any) -> list[str]:
        return [cls.sentences[name]] if name in cls.sentences else forms.wrong_reason(str(value))


def _unread(value: Any) -> list[str]:
    unseen = unseen_in(value)
    return [lazy_gettext("Leave out the invisible character {code}.", code=unseen)] if unseen else []


class Act(ActModel):
    """An act that the gate decides. `becomes` is the gate command it is."""

    becomes: ClassVar[type[Command]]

    def to_command(self, actor: Actor, **named: Any) -> Any:
        """The gate command, in the name of this person. `named`: what the address names and the command carries."""
        return self.becomes(actor=actor, **self.fields(), **named)

    def fields(self) -> dict[str, Any]:
        """The command's fields other than its actor and what the address names."""
        return dict(self)
