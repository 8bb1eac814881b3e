#!/usr/bin/perl -0p
# What Doxygen reads of a header. Names of the namespace detail, which nobody needs, become
# `unspecified`, as in the C++ standard; requirements that are nothing else are left out.
BEGIN {
  our $name = qr/(?:typename\s+)?(?:\besokit::)?\bdetail::\w+(<(?:[^<>()]|\((?:[^()]|\([^()]*\))*\)|(?-1))*>)?(?:::\w+)*/;
}
s/friend [^;{]*detail::[^;{]*;//g;
s/(template\s*<|,\s*)$name\s+(\w+)(?=\s*[,>])/$1class $3/g;
s/$name/unspecified/g;
s/(concept \w*(?:AsDeclared|HasNoMisspelled)\w* =)[^;]*unspecified(?:[^;{]|\{[^}]*\})*;/$1 unspecified;/g;
s/requires\s+unspecified\s*&&\s*/requires /g;
s/requires\s+(?:unspecified(?!\s*[&|(])|\(unspecified\s*&&\s*\.\.\.\))//g;
s/\s*:\s*public unspecified(?:,\s*public unspecified)*(?=\s*\{)//g;
s/public unspecified,\s*|,\s*public unspecified//g;
