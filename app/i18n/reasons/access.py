"""Holds the sentences of sign-in, permissions, accounts and the identity provider, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "access_token_missing": N_("The identity provider gave no access token to ask it for groups with"),
    "access_token_unknown_kind": N_("The identity provider's access token is of no kind that is known here"),
    "account_disabled": N_("Your account here is disabled"),
    "account_needed": N_("Only somebody who signed in to an account may {meaning:word}"),
    "account_name_invalid": N_("A name is 1 to 40 of a-z, 0-9, dot, dash, underscore"),
    "account_without_role": N_("An account needs at least one role"),
    "answer_of_other_issuer": N_("The answer comes from another issuer than the one that was asked"),
    "authority_unreadable": N_("The certificates to trust cannot be read: {error}"),
    "client_credentials_refused": N_("The identity provider does not take this console's own credentials"),
    "client_secret_empty": N_("The file of the client secret is empty"),
    "client_secret_twice": N_("The client secret is given twice"),
    "client_secret_unreadable": N_("The client secret cannot be read ({kind})"),
    "client_unregistered": N_("The identity provider does not know this console"),
    "login_file_open_to_others": N_("Others may read the file with the token of this terminal's session"),
    "network_invalid": N_("“{network}” is no network"),
    "no_account_yet": N_("Nobody has an account in this data folder"),
    "sign_in_refused": N_("This name and password do not go together"),
    "terminal_needs_account": N_("A token for a terminal is made by somebody who signed in to an account in a browser"),
    "terminal_token_refused": N_("This is no token for a terminal of {name}, or its session is over"),
    "sign_in_throttled": N_("Too many wrong passwords: wait {wait_s:.0f} s"),
    "command_is_built": N_("{command} is built by the harness from what a person asked"),
    "command_is_internal": N_("{command} is the harness's own"),
    "exposed_without_account": N_("Others would reach {host}, and nobody has an account"),
    "exposed_without_encryption": N_(
        "Others would reach {host} without encryption: passwords would be readable on the way"
    ),
    "first_account_not_admin": N_("The first account must be an admin"),
    "first_person_not_admin": N_("The first account here must be an admin's"),
    "group_role_invalid": N_("The group “{group}” is given no role that exists"),
    "groups_unavailable": N_("The identity provider answers {status} where it should say which groups somebody is in"),
    "identity_incomplete": N_("An identity is an issuer and a subject"),
    "identity_setting_unreadable": N_("A setting of the identity provider cannot be read"),
    "identity_token_expired": N_("The identity token is no longer good"),
    "identity_token_key_unpublished": N_("The identity token names a key that the issuer does not publish"),
    "identity_token_of_other_issuer": N_("The identity token comes from another issuer"),
    "identity_token_of_other_sign_in": N_("The identity token was made for another sign-in"),
    "identity_token_signature_bad": N_("The identity token is not signed by the identity provider"),
    "identity_token_unbelievable": N_("The identity token cannot be believed"),
    "identity_token_unsigned": N_("The identity token is not signed with a key of the identity provider's own"),
    "issuer_address_outside": N_("The identity provider names an address outside of what is configured"),
    "issuer_address_untrusted": N_("The identity provider's address is none that can be trusted"),
    "issuer_answer_excessive": N_("The identity provider's answer is too large or too slow"),
    "issuer_answer_unreadable": N_("The identity provider answers {status} with nothing that can be read"),
    "issuer_declined": N_("The identity provider did not let you in"),
    "issuer_keys_unavailable": N_("The identity provider answers {status} for its keys"),
    "issuer_misnamed": N_("The identity provider calls itself something else than what is configured"),
    "issuer_undescribed": N_("The identity provider answers {status} where it should describe itself"),
    "issuer_unreachable": N_("The identity provider does not answer ({kind})"),
    "last_admin": N_("{name} is the last admin"),
    "no_identity_linked": N_("Nobody signs in as {name} at an identity provider"),
    "no_identity_provider": N_("No identity provider is set up here."),
    "no_permission_declared_for": N_("Nobody has declared who may give {command}"),
    "nobody_signed_in": N_("Nobody is known to ask for this"),
    "notify_address_unknown": N_("The address of the service “{name}” is none that Apprise knows"),
    "only_identity": N_("{name} has no other way in than the identity provider"),
    "password_of_identity_provider": N_("The password of {name} is the identity provider's matter"),
    "password_weak": N_(
        "A password has {shortest} to {longest} signs, at least five different ones, and not the name in it"
    ),
    "password_wrong": N_("That is not your present password"),
    "person_mismatch": N_("The identity provider speaks of somebody else than who signed in"),
    "proxy_without_names": N_("A proxy is declared, and no name under which people reach it"),
    "role_missing": N_("You are known to the identity provider, and have no role here"),
    "role_not_permitted": N_("Your role does not let you {meaning:word}"),
    "roles_of_identity_provider": N_("The roles of {name} are the identity provider's matter"),
    "sign_in_answer_foreign": N_("The answer does not belong to the sign-in that this browser began"),
    "sign_in_code_refused": N_(
        "The identity provider does not take the code that it gave: it is good once, for a short while"
    ),
    "sign_in_not_begun": N_("This browser began no such sign-in, or it was used already"),
    "tls_incomplete": N_("TLS needs a certificate and its key"),
    "token_name_or_scope_invalid": N_(
        "A token needs a name of a-z, 0-9, dot, dash, underscore and scopes that integrations may have"
    ),
    "token_not_permitted": N_("This token may not {meaning:word}"),
    "token_of_other_robot": N_("This token is for {robot_id}"),
    "unknown_account": N_("There is no account {name}"),
    "unknown_token": N_("There is no token {token_id}"),
}
REMEDIES: Mapping[str, str] = {
    "access_token_missing": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "access_token_unknown_kind": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "account_disabled": N_("ask an admin of this console to enable it"),
    "account_without_role": N_("choose from {roles}"),
    "account_needed": N_("sign in with `regen login NAME`; `regen account add NAME --role ROLE` makes an account"),
    "answer_of_other_issuer": N_("close this page and sign in again from the console's own"),
    "authority_unreadable": N_("name a file of PEM certificates that this user may read"),
    "client_credentials_refused": N_("an admin checks REGEN_OIDC_CLIENT_ID and the client secret"),
    "client_secret_twice": N_("keep one of them"),
    "client_secret_unreadable": N_("name a file of one line that this user may read"),
    "client_unregistered": N_("register {address} there, and set the client id that it gives"),
    "command_is_built": N_("ask for what you want done"),
    "command_is_internal": N_("ask for what you want done, not for its steps"),
    "exposed_without_account": N_("add an admin with `regen account add NAME --role admin`, or listen on 127.0.0.1"),
    "exposed_without_encryption": N_(
        "set REGEN_TLS_CERTIFICATE and REGEN_TLS_KEY, or REGEN_PROXIES to the addresses of a TLS proxy in front"
    ),
    "first_account_not_admin": N_("add the role admin"),
    "first_person_not_admin": N_("let an admin sign in first, or add one with `regen account add NAME --role admin`"),
    "group_role_invalid": N_("choose from {roles}"),
    "groups_unavailable": N_("an admin checks REGEN_OIDC_SCOPES and what this console may ask there"),
    "identity_incomplete": N_("give the subject (sub) that the identity provider shows for this person"),
    "identity_setting_unreadable": N_('lists and roles are written as JSON, lists as in ["openid", "profile"]'),
    "identity_token_expired": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_key_unpublished": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_of_other_issuer": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_of_other_sign_in": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_signature_bad": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_unbelievable": N_(
        "sign in again; if it stays so, an admin looks at the settings of the identity provider"
    ),
    "identity_token_unsigned": N_(
        "an admin has the provider sign with RS256, ES256 or another of the asymmetric algorithms"
    ),
    "issuer_address_outside": N_("an admin checks REGEN_OIDC_ISSUER, or adds the host to REGEN_OIDC_HOSTS"),
    "issuer_address_untrusted": N_("give its https address as the provider writes it itself, without query"),
    "issuer_answer_excessive": N_(
        "ask an admin whether the identity provider runs and can be reached from this machine; a password "
        "works meanwhile"
    ),
    "issuer_answer_unreadable": N_(
        "ask an admin whether the identity provider runs and can be reached from this machine; a password "
        "works meanwhile"
    ),
    "issuer_declined": N_("sign in there with an account that may use this console, or sign in here with a password"),
    "issuer_misnamed": N_("an admin sets REGEN_OIDC_ISSUER to exactly what the provider calls itself"),
    "issuer_undescribed": N_("an admin checks REGEN_OIDC_ISSUER"),
    "issuer_unreachable": N_(
        "ask an admin whether the identity provider runs and can be reached from this machine; a password "
        "works meanwhile"
    ),
    "last_admin": N_("make somebody else an admin first"),
    "no_identity_linked": N_("see `regen account list`"),
    "no_identity_provider": N_("Sign in with your password."),
    "no_permission_declared_for": N_("list the command there, as a person's or as the harness's own"),
    "login_file_open_to_others": N_("chmod 600 it, or delete it and sign in again"),
    "network_invalid": N_("write a network as 10.1.0.0/16 or fd00::/8"),
    "terminal_needs_account": N_("sign in with your account first"),
    "terminal_token_refused": N_("make another one on your account page"),
    "no_account_yet": N_("make the first one with `regen account add NAME --role admin --role operator`"),
    "nobody_signed_in": N_("sign in, or use a token"),
    "notify_address_unknown": N_(
        "give names and addresses as JSON, as in the documentation of Apprise; the address is not shown here"
    ),
    "only_identity": N_("disable the account instead"),
    "password_of_identity_provider": N_("they sign in there"),
    "password_weak": N_("a sentence is easy to remember and long enough"),
    "person_mismatch": N_("sign in again; if it stays so, an admin looks at the settings of the identity provider"),
    "proxy_without_names": N_("set REGEN_NAMES to the names that stand in people's address bars"),
    "role_missing": N_("ask an admin of this console to give one of your groups a role, or to link your account"),
    "role_not_permitted": N_("ask somebody who is {roles}, or an admin to change your role"),
    "roles_of_identity_provider": N_("change their groups there, or what REGEN_OIDC_ROLES makes of them"),
    "sign_in_answer_foreign": N_(
        "begin again from the sign-in page of this console, in the same browser, and within ten minutes"
    ),
    "sign_in_code_refused": N_("sign in again"),
    "sign_in_not_begun": N_(
        "begin again from the sign-in page of this console, in the same browser, and within ten minutes"
    ),
    "tls_incomplete": N_("set both REGEN_TLS_CERTIFICATE and REGEN_TLS_KEY, or neither"),
    "token_name_or_scope_invalid": N_("choose from {scopes}"),
    "token_not_permitted": N_("use a token with the scope {scope}"),
    "token_of_other_robot": N_("use one for that robot"),
    "unknown_account": N_("list them with `regen account list`"),
    "unknown_token": N_("list them with `regen token list`"),
}
"""What to do about it."""
