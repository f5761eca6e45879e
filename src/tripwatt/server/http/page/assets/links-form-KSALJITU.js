import{o as h}from"./chunk-IWEE7Z4X.js";import{Dc as N,Gc as f,Oc as k,Qc as O,a as r,d as b,i as v}from"./chunk-VDLMCOI6.js";var d=`510
1.8  30  515
8.6  68  560
23  120  780
23.5  116  540
7.8  54  490`;function S(s,{distance:i,speed:l,height:n}){let c=t=>Number(t.replace(/,$/,"").replace(",",".")),p=s.split(`
`).map(t=>t.split(/[;\s]+/).filter(Boolean).map(c)),[o,...u]=p.filter(t=>t.length>0),e=o&&o.length>1?[o,...u]:u,m=[o,...u].find(t=>t&&t.length!==2)?.at(-1),a=m===void 0?null:n.to(m);return e.map(([t=Number.NaN,x=Number.NaN,g])=>{let y=a;g!==void 0&&(a=n.to(g));let _=l.to(x);return{length_m:i.to(t),speed_m_s:_,..._>=15&&{stop_s:0},...a!==null&&{start_elevation_m:y,end_elevation_m:a}}})}function D(){let[s,i]=b(""),l=v(),{linksForm:n}=N.value,{distance:c,speed:p,height:o}=f.value;return r("form",{class:"links",onSubmit:k(()=>{let e=s.trim()||d;i(e);let m=/^[[{]/.test(e)?e:JSON.stringify(S(e,f.value));h(m,"","links",0)})},r("label",{for:l},n.given(c.unit,p.unit,o.unit)),r("textarea",{id:l,rows:7,spellcheck:!1,value:s,placeholder:d,onInput:e=>i(e.currentTarget.value)}),r(O,{label:s.trim()?n.use:n.example}))}export{D as LinksForm};
