"""Holds the sentences of models behind the model port, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "advice_not_next_step": N_("the ladder's next step is {following:word}, not {action}"),
    "advice_not_on_ladder": N_("{action} is no step of this failure's ladder ({ladder:words})"),
    "model_said": N_("{model}: “{text}”"),
    "model_answer_cut_off": N_("The model's answer was cut off at its limit of tokens"),
    "model_answer_empty": N_("The model answered nothing"),
    "model_answer_nested": N_("The model's answer is nested too deeply"),
    "model_answer_too_large": N_("The endpoint's answer is larger than {limit_mib} MiB"),
    "model_answers_status": N_("The model's endpoint answered with status {status}"),
    "model_cost_limit_reached": N_("{spent:.4f} {currency} were spent on this model; the limit is {limit:.4f}"),
    "model_gave_no_answer": N_("The model's endpoint gave no whole answer in time ({error})"),
    "model_image_too_large": N_("An image for the model is larger than {limit_mib} MiB"),
    "model_images_too_many": N_("The model was to be shown {images} images, at most {most} are sent"),
    "model_key_in_clear": N_("The key of the model {name} would cross the network without encryption"),
    "model_key_not_there": N_("The key of the model {name} is not there yet ({reference})"),
    "model_redirects": N_("The model's endpoint redirects (status {status}), which is not followed"),
    "model_speaks_other_protocol": N_("The endpoint's answer is none of the chat-completions protocol: {error}"),
    "model_takes_no_images": N_("The model takes no images"),
    "model_without_role": N_("The model {name} has no role, and is not used"),
    "role_needs_images": N_("The role {role} is shown images, and the model {name} takes none"),
    "role_of_unknown_model": N_("The role {role} names the model {name}, which is not declared; declared: {names}"),
}
REMEDIES: Mapping[str, str] = {
    "model_answer_cut_off": N_("raise max_tokens in models.yaml, or use a model that answers more briefly"),
    "model_answer_empty": N_("look at the endpoint's log"),
    "model_answer_nested": N_("look at what the endpoint answers"),
    "model_answer_too_large": N_("look at what the endpoint answers"),
    "model_answers_status": N_("look at the endpoint's log; check the model's name and key in models.yaml"),
    "model_cost_limit_reached": N_("raise price.limit in models.yaml and start the console again"),
    "model_gave_no_answer": N_("look at the endpoint, or raise timeout_s in models.yaml"),
    "model_image_too_large": N_("send a smaller image"),
    "model_images_too_many": N_("send fewer images"),
    "model_key_in_clear": N_("use an https address"),
    "model_key_not_there": N_("set the variable, or write the file"),
    "model_redirects": N_("write the final address into models.yaml"),
    "model_speaks_other_protocol": N_("check base_url in models.yaml; it often ends in /v1"),
    "model_takes_no_images": N_("set images: true in models.yaml if it does"),
    "model_without_role": N_("give it a role, or remove it"),
    "role_needs_images": N_("name a model with images: true"),
    "role_of_unknown_model": N_("write one of the declared names"),
}
